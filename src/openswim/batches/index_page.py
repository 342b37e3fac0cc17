"""The page of a watched folder: the latest pictures and an archive. It asks nothing of any server, and runs nothing."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from urllib.parse import quote

from openswim.batches.plan import Plan
from openswim.batches.records import Record
from openswim.scene.files import check_ours, written_whole

PAGE, STYLE = "index.html", "style.css"
MOST_SHOWN = 60  # pictures of the latest times
MOST_FAILURES = 20
REFRESH_S = 60
_MARK = '<meta name="generator" content="OpenSWIm">'
_STYLE_MARK = "/* of OpenSWIm's page */"
_POLICY = "default-src 'none'; img-src 'self'; style-src 'self'"
_BROWSERS = (".png", ".jpg", ".jpeg")  # what they show


def check_index(folder: Path) -> None:
    """Raise UserError where the page or its style would replace somebody else's."""
    for name, mark in ((PAGE, _MARK), (STYLE, _STYLE_MARK)):
        check_ours(folder / name, mark, "choose another folder with -o")


def write_index(plan: Plan, standing: Sequence[Record], failures: Mapping[str, str]) -> None:
    """Write the page and its style, each whole or not at all."""
    plan.folder.mkdir(parents=True, exist_ok=True)
    style = (Path(__file__).parent / STYLE).read_text("utf-8")
    for name, text in ((STYLE, style), (PAGE, page_of(standing, failures, datetime.now(UTC)))):
        with written_whole(plan.folder / name) as partial:
            partial.write_text(text, "utf-8", "backslashreplace")  # names may be no text


def page_of(standing: Sequence[Record], failures: Mapping[str, str], now: datetime) -> str:
    """All of it; every text is escaped, and there is neither style nor script in it."""
    body = [
        f"<h1>Skies</h1><p>Written {now:%Y-%m-%d %H:%M:%S} UTC. {_count(standing)} in the archive.</p>",
        *_latest(standing), *_failed(failures), *_archive(standing),
    ]  # fmt: skip
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">{_MARK}'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        f'<meta http-equiv="refresh" content="{REFRESH_S}"><meta name="viewport" content="width=device-width">'
        f'<title>Skies</title><link rel="stylesheet" href="{STYLE}"></head><body>\n' + "\n".join(body)
        + "\n</body></html>\n"
    )  # fmt: skip


def _latest(standing: Sequence[Record]) -> list[str]:
    """The pictures of each run's newest time."""
    newest = {record.weather: record.time for record in standing}  # they come by time
    shown = [(record, name, files) for record in standing if record.time == newest[record.weather]
             for name, files in sorted(record.files.items())]  # fmt: skip
    out = []
    for record, camera, files in shown[:MOST_SHOWN]:
        for file in files:
            if os.path.splitext(file)[1] in _BROWSERS:
                text = f"{camera}, {_time(record)}{' UTC' if record.time != 'None' else ''}"
                text += f", {record.weather}" if record.weather else ""
                out.append(f'<figure><a href="{_link(file)}"><img src="{_link(file)}" alt="{escape(text)}" '
                           f'loading="lazy"></a><figcaption>{escape(text)}</figcaption></figure>')  # fmt: skip
    return ["<h2>Latest</h2>", '<div class="latest">', *out, "</div>"] if out else ["<p>No picture yet.</p>"]


def _failed(failures: Mapping[str, str]) -> list[str]:
    if not failures:
        return []
    lines = [f"<li>{escape(task)}: {escape(why)}</li>" for task, why in list(failures.items())[-MOST_FAILURES:]]
    return ["<h2>Failed</h2>", "<ul>", *lines, "</ul>"]


def _archive(standing: Sequence[Record]) -> list[str]:
    """A line for each time, the newest first."""
    rows = []
    runs = any(record.weather for record in standing)
    for record in reversed(standing):
        links = [f'<a href="{_link(file)}">{escape(Path(file).name)}</a>'
                 for _, files in sorted(record.files.items()) for file in files]  # fmt: skip
        run = f"<td>{escape(record.weather)}</td>" if runs else ""
        rows.append(f"<tr><td>{escape(_time(record))}</td>{run}<td>{' '.join(links)}</td></tr>")
    head = f"<tr><th>time, UTC</th>{'<th>run</th>' if runs else ''}<th>files</th></tr>"
    return ["<h2>Archive</h2>", "<table>", head, *rows, "</table>"]


def _count(standing: Sequence[Record]) -> str:
    return f"{len(standing)} time{'' if len(standing) == 1 else 's'}"


def _time(record: Record) -> str:
    return record.time[:19].replace("T", " ") if record.time != "None" else "no time"


def _link(file: str) -> str:
    return escape(quote(file))
