"""The Python of docs/assimilation.md runs as pasted."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from openswim.assimilation.report import _irradiance

PAGE = Path(__file__).parents[2] / "docs/assimilation.md"


def test_irradiance_beyond_what_was_observed_is_in_the_plot() -> None:
    """Observed 612, seen 1304 before and 1247 after."""
    found = SimpleNamespace(
        rows=SimpleNamespace(irradiance_w_m2=lambda row: np.array([row])), observed={"value": 612.0}, before=1304.0,
        after=1247.0,
    )  # fmt: skip
    assert _irradiance(found).count("<circle") == 2  # type: ignore[arg-type]


@pytest.mark.slow
def test_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for block in re.findall(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL):
        exec(compile(block, PAGE.name, "exec"), names)
    analysis, truth = names["analysis"], names["truth"]
    assert max(analysis.rms(analysis.after)) < 0.5 * min(analysis.rms(analysis.before))
    found, first = (np.abs(s["extinction_cloud"].values - truth).sum() for s in (analysis.state, analysis.first))
    assert found < 0.42 * first  # .32
    page = (tmp_path / "analysis.html").read_text("utf-8")
    assert page.count("W m-2 sr-1 nm-1") == 4  # the scale of each camera's pictures
    assert "extinction_cloud, sum over the levels" in page
    # JEDI's gradient and PDAF's are the same thing, within 1.1e-6 where either is solved to the light's tolerance
    departure = (names["hofx"] - names["observed"]["value"].values) / names["observed"]["error"].values ** 2
    assert float(names["dy"] @ departure) == pytest.approx(
        float((0.1 * names["state"]["extinction_cloud"] * names["gradient"]["extinction_cloud"]).sum()), rel=1.4e-6
    )
    assert names["expected"].shape == (4, names["op"].size)
    assert len(names["posterior"]) == 4


@pytest.mark.slow
def test_the_notebook_runs_on_a_smaller_field(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    notebook = json.loads((PAGE.parent / "tutorials/clouds_from_cameras.ipynb").read_text("utf-8"))
    for cell in notebook["cells"]:
        text = "".join(cell["source"]).replace("ITERATIONS = 24, 50.0, 30", "ITERATIONS = 12, 90.0, 8")
        if cell["cell_type"] == "code":
            exec(compile(text.replace("size=32", "size=12").replace("(32, 32)", "(12, 12)"), "notebook", "exec"), names)
    names["plt"].close("all")
    assert names["errors"]["analysis"] < 0.85 * names["errors"]["first guess"]
    assert names["r"]["analysis"] > names["r"]["first guess"]
