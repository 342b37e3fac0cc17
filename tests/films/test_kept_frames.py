"""Frames of a film in the making: whose they are, and that one film at a time is made of them."""

from pathlib import Path

import numpy as np
import pytest

from openswim import UserError
from openswim.films.kept_frames import KeptFrame, KeptFrames


def test_frames_of_another_film_are_not_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENSWIM_PROGRESS", "1")
    frame = KeptFrame(np.ones((2, 3, 3), np.float16), {"exposure": 2.0})
    with KeptFrames(tmp_path / "film.mp4", {"a": 1}).held() as kept:
        kept.put(0, frame)
    with KeptFrames(tmp_path / "film.mp4", {"a": 1}).held() as kept:
        np.testing.assert_array_equal(kept.get(0).light, frame.light)
    assert capsys.readouterr().err == f"note: {tmp_path}/film.mp4: frames that are there already: 1\n"
    with KeptFrames(tmp_path / "film.mp4", {"a": 2}).held() as kept:
        assert not kept.has(0)
    assert "frames of other options, or of files that have changed since, are thrown away: 1" in capsys.readouterr().err
    with KeptFrames(tmp_path / "film.mp4", {"a": 1}).held() as kept:
        assert not kept.has(0)


def test_frames_of_a_film_with_a_long_name_are_kept(tmp_path: Path) -> None:
    first, second = (KeptFrames(tmp_path / f"{letter * 251}.mp4", {"a": 1}) for letter in "ab")
    with first.held(), second.held():
        first.put(0, KeptFrame(np.ones((2, 3, 3), np.float16), {"exposure": 2.0}))
        assert KeptFrames(tmp_path / f"{'a' * 251}.mp4", {"a": 1}).has(0)
        assert not second.has(0)


@pytest.mark.parametrize("other", [1, 2])
def test_two_films_into_one_output_are_one_too_many(tmp_path: Path, other: int) -> None:
    frame = KeptFrame(np.ones((2, 3, 3), np.float16), {"exposure": 1.0})
    with KeptFrames(tmp_path / "film.mp4", {"a": 1}).held() as kept:
        kept.put(0, frame)
        with (
            pytest.raises(UserError, match=r"film\.mp4: is being made by another process: wait"),
            KeptFrames(tmp_path / "film.mp4", {"a": other}).held(),
        ):
            pass
        assert kept.has(0)
    (kept.folder / ".openswim-dead").mkdir()
    with KeptFrames(tmp_path / "film.mp4", {"a": other}).held() as again:
        assert again.has(0) == (other == 1)
        again.remove()
    assert not kept.folder.exists()


def test_a_film_that_is_refused_leaves_no_folder(tmp_path: Path) -> None:
    kept = KeptFrames(tmp_path / "film.mp4", {"a": 1})
    with pytest.raises(UserError, match="no sun"), kept.held():
        raise UserError("no sun")
    assert not list(tmp_path.iterdir())


def test_a_hidden_folder_of_others_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / ".film-film.mp4.frames").mkdir()
    (tmp_path / ".film-film.mp4.frames" / "letter.txt").write_text("x")
    with pytest.raises(UserError, match="no film's"), KeptFrames(tmp_path / "film.mp4", {"a": 1}).held():
        pass
    assert (tmp_path / ".film-film.mp4.frames" / "letter.txt").read_text() == "x"
