"""Opens and writes the figures that matplotlib draws; matplotlib is an extra and only needed for a picture."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import check_folder, write_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENDINGS = (".png", ".svg", ".pdf")


def need_matplotlib() -> None:
    """Checks that matplotlib is installed; MotiondeckError says how to install it."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise MotiondeckError("drawing needs matplotlib; install it with: pip install 'motiondeck[plot]'") from None


def check_picture(path: Path) -> None:
    """Checks early that a picture can be drawn: MotiondeckError without matplotlib or folder, or for another ending."""
    need_matplotlib()
    if path.suffix.lower() not in ENDINGS:
        raise MotiondeckError(f"{path}: pictures end in {', '.join(ENDINGS)}")
    check_folder(path)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, inches; drawn off screen. MotiondeckError if matplotlib is not installed."""
    need_matplotlib()
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def save(figure: Figure, path: Path) -> None:
    """Writes a figure in the format of the file's ending; MotiondeckError if it cannot be written."""
    drawn = io.BytesIO()
    try:
        figure.savefig(drawn, dpi=120, format=path.suffix[1:].lower())
    except ValueError as error:
        raise MotiondeckError(f"{path}: cannot be drawn ({error})") from None
    write_file(path, drawn.getvalue())
