"""The files that come along with a picture: a Radiance sky is one of three."""

from pathlib import Path

BESIDE = {".cal": "sky_turn = ", ".rad": "openswim_sky"}  # suffixes, and by what each file is known as ours


def beside(path: Path, view: object) -> list[Path]:
    """The files that come along with a picture of linear light."""
    comes = path.suffix.lower() == ".hdr" and view in ("panorama", "sphere")
    return [path.with_suffix(suffix) for suffix in BESIDE] if comes else []
