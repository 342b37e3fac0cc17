"""Progress: silent for quick jobs, one line for slow ones, swappable, gone when done."""

import io

import pytest

from openswim import progress
from openswim.progress import Bar, Quiet, job, track, use


class Recorder:
    """A meter that remembers."""

    def __init__(self) -> None:
        self.events: list[tuple] = []

    def start(self, label: str, total: float | None) -> None:
        self.events.append(("start", label, total))

    def advance(self, steps: float = 1) -> None:
        self.events.append(("advance", steps))

    def close(self) -> None:
        self.events.append(("close",))


def test_track_yields_everything_and_counts() -> None:
    recorder = Recorder()
    with use(recorder):
        assert list(track("abc", "letters")) == ["a", "b", "c"]
    assert recorder.events == [("start", "letters", 3), *[("advance", 1)] * 3, ("close",)]


def test_a_meter_is_closed_when_the_job_fails() -> None:
    recorder = Recorder()
    with pytest.raises(ZeroDivisionError), use(recorder), job("doomed", 2):
        raise ZeroDivisionError
    assert recorder.events[-1] == ("close",)


def test_a_quick_job_shows_nothing() -> None:
    stream = io.StringIO()
    with use(Bar(stream)), job("quick", 1000) as meter:
        for _ in range(1000):
            meter.advance()
    assert stream.getvalue() == ""


def test_a_slow_job_shows_a_bar_and_removes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    stream = io.StringIO()
    with use(Bar(stream)), job("sweeps", 4) as meter:
        clock[0] = 1.0
        meter.advance()
        assert stream.getvalue() == ""
        clock[0] = 3.0
        meter.advance()
        assert "sweeps [###############---------------]  50 %, 3 s left" in stream.getvalue()
    lines = stream.getvalue().split("\r")
    assert lines[-1] == ""
    assert lines[-2].strip() == ""
    assert "\n" not in stream.getvalue()


def test_nobody_watching_means_quiet(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OPENSWIM_PROGRESS", raising=False)
    with job("unseen") as meter:
        assert isinstance(meter, Quiet)
    monkeypatch.setenv("OPENSWIM_PROGRESS", "1")
    with job("seen") as meter:
        assert isinstance(meter, Bar)
