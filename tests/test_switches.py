"""Variables of the environment that switch something on or off."""

import pytest

from openswim import UserError
from openswim.switches import switched


@pytest.mark.parametrize(
    ("told", "on"), [("1", True), (" Yes ", True), ("no", False), ("OFF", False), ("false", False), ("", None)]
)
def test_switches_of_the_environment(told: str, on: bool | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENSWIM_PROGRESS", told)
    assert switched("OPENSWIM_PROGRESS") is on
    monkeypatch.setenv("OPENSWIM_PROGRESS", "maybe")
    with pytest.raises(UserError, match=r"OPENSWIM_PROGRESS is 'maybe': set it to 1 \(on"):
        switched("OPENSWIM_PROGRESS")
