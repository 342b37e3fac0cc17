"""Whether a picture can be drawn, told before any work is done."""

from pathlib import Path

from openswim.errors import UserError


def check_plot(path: Path, extra: str) -> None:
    """Raise UserError unless matplotlib, which an extra of the package brings, could draw this kind of picture."""
    try:
        from matplotlib.backend_bases import FigureCanvasBase
    except ImportError as error:
        raise UserError(f"--plot needs the package matplotlib: pip install 'openswim[{extra}]'") from error
    if path.suffix.lower().removeprefix(".") not in FigureCanvasBase.get_supported_filetypes():
        raise UserError(f"--plot {path}: suffix {path.suffix!r} is unknown; use .png, .pdf or .svg")
