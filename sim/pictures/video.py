"""Films and contact sheets: a motion as an mp4, a GIF, or a row of pictures."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
from PIL import Image, ImageDraw, ImageFont

from controller.rotations import Array
from sim.pictures.offscreen import OffScreen, PictureError

GIF_COLOURS = 64
FRAMES_A_ROW = 8


def render(
    model: mujoco.MjModel,
    frames: Iterable[Array],
    path: Path,
    fps: float = 30.0,
    size: tuple[int, int] = (640, 480),
    shadows: bool = False,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Films a robot and returns the number of frames; nothing is left behind if it does not come to its end.

    Args:
        model: the robot on its stage.
        frames: one qpos (nq,) a picture.
        path: where to; the name ends in .mp4 or .gif.
        fps: pictures a second.
        size: width and height, pixels; even numbers for mp4.
        shadows: prettier and about twice as slow.
        progress: told the number of frames done.

    Raises:
        PictureError: for another ending, for no frames, and where OpenGL or ffmpeg is missing.
    """
    writers = {".mp4": _write_mp4, ".gif": _write_gif}
    if path.suffix.lower() not in writers:
        raise PictureError(f"{path}: a film ends in {' or '.join(writers)}")
    count = 0

    def pictures() -> Iterator[bytes]:
        nonlocal count
        for qpos in frames:
            yield screen.draw(qpos).tobytes()
            count += 1
            if progress:
                progress(count)

    with _written_whole(path) as unfinished, OffScreen(model, size, shadows) as screen:
        writers[path.suffix.lower()](pictures(), unfinished, fps, size)
        if count == 0:
            raise PictureError(f"{path}: there are no frames to film")
    return count


def contact_sheet(
    model: mujoco.MjModel,
    rows: Sequence[tuple[str, Sequence[Array]]],
    path: Path,
    tile: tuple[int, int] = (200, 220),
) -> None:
    """Draws one row a motion, its label on the left, into one picture.

    Args:
        model: the robot on its stage.
        rows: a label and up to 8 qpos (nq,) each.
        path: where to; a name that pillow knows how to write, such as .png.
        tile: width and height of one picture, pixels.

    Raises:
        PictureError: for no rows, for another file type, and where OpenGL is missing.
    """
    bodies_sheet([(label, model, poses) for label, poses in rows], path, tile)


def bodies_sheet(
    rows: Sequence[tuple[str, mujoco.MjModel, Sequence[Array]]], path: Path, tile: tuple[int, int] = (200, 220)
) -> None:
    """As `contact_sheet`, with a body of its own in each row."""
    if not rows:
        raise PictureError(f"{path}: there are no motions to show")
    if path.suffix.lower() not in Image.registered_extensions():
        raise PictureError(f"{path}: a contact sheet ends in .png, .jpg or .webp")
    width, height = tile
    margin = 120
    sheet = Image.new("RGB", (margin + FRAMES_A_ROW * width, len(rows) * height), "white")
    pen = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(15)
    with _written_whole(path) as unfinished:
        for model, numbered in itertools.groupby(enumerate(rows), key=lambda row: row[1][1]):
            with OffScreen(model, tile) as screen:
                for row, (label, _, poses) in numbered:
                    text = textwrap.fill(label, 11)
                    pen.text((12, (row + 0.5) * height), text, fill=(40, 46, 56), font=font, anchor="lm")
                    for column, qpos in enumerate(poses[:FRAMES_A_ROW]):
                        picture = Image.fromarray(screen.draw(qpos, cut=True))
                        sheet.paste(picture, (margin + column * width, row * height))
        # A palette of 256 colours makes a quarter of the file, and nobody sees it.
        (sheet.quantize(256, dither=Image.Dither.NONE) if path.suffix.lower() == ".png" else sheet).save(unfinished)


@contextmanager
def _written_whole(path: Path) -> Iterator[Path]:
    """A name to write to that becomes the file only if all went well."""
    if not path.parent.is_dir():
        raise PictureError(f"{path}: there is no folder {path.parent}")
    unfinished = path.with_name(f".{path.stem}.unfinished{path.suffix}")
    try:
        # Better to learn now that nothing can be written here than after minutes of drawing.
        unfinished.touch()
    except OSError as error:
        raise PictureError(f"{path}: cannot be written ({error.strerror})") from error
    try:
        yield unfinished
        unfinished.replace(path)
    except OSError as error:
        raise PictureError(f"{path}: cannot be written ({error.strerror})") from error
    finally:
        unfinished.unlink(missing_ok=True)


def _write_mp4(pictures: Iterator[bytes], path: Path, fps: float, size: tuple[int, int]) -> None:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise PictureError('a film needs ffmpeg: pip install "motiondeck[video]"') from error
    if size[0] % 2 or size[1] % 2:
        raise PictureError(f"{path}: an mp4 needs an even width and height, not {size[0]} x {size[1]}")
    rate: Any = fps  # ffmpeg takes any number, whatever the annotation says
    writer = imageio_ffmpeg.write_frames(
        str(path), size, fps=rate, quality=8, macro_block_size=2, ffmpeg_log_level="error"
    )
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(picture)
    finally:
        writer.close()


def _write_gif(pictures: Iterator[bytes], path: Path, fps: float, size: tuple[int, int]) -> None:
    # One palette for all frames and no dithering keep the floor from flickering and the file small; it covers the range
    # of colours rather than their areas, or the floor would take them all.
    images = (Image.frombytes("RGB", size, picture) for picture in pictures)
    first = next(images, None)
    if first is None:
        return
    palette = first.quantize(GIF_COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    rest = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    palette.save(path, save_all=True, append_images=rest, duration=round(1000.0 / fps), loop=0, optimize=True)
