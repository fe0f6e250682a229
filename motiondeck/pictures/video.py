"""Writes films (mp4, GIF) and contact sheets of MuJoCo models."""

import errno
import itertools
import os
import shutil
import textwrap
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
from PIL import Image, ImageDraw, ImageFont

from controller.motion.rotations import Array
from motiondeck.pictures.offscreen import Camera, OffScreen
from motiondeck.pictures.offscreen import Image as Drawn
from motiondeck_base.errors import MotiondeckError

GIF_COLOURS = 64
FRAMES_A_ROW = 8
MOST = 4  # screens, one thread each: OpenGL in software does most of its work on one core


@dataclass(frozen=True)
class Shot:
    """One picture of a film."""

    qpos: Array  # the robot, shape (nq,)
    ghost: Array | None = None  # the robot drawn translucent as well, shape (nq,)
    prints: Sequence[Array] = ()  # corners of footprints on the floor, shape (4, 3) each, m


@contextmanager
def screens(
    model: mujoco.MjModel, size: tuple[int, int], shadows: bool, camera: Camera
) -> Iterator[Callable[[Iterable[Shot]], Iterator[Drawn]]]:
    """One `OffScreen` per core of this process, up to MOST, in the block; yields what draws shots on them, in order."""
    from joblib import cpu_count  # slow to import

    with ExitStack() as opened:
        every: list[tuple[ThreadPoolExecutor, OffScreen]] = []
        for _ in range(min(cpu_count(), MOST)):
            # OpenGL wants a context to be used, and freed, in the thread that made it.
            thread = opened.enter_context(ThreadPoolExecutor(1))
            screen = thread.submit(OffScreen, model, size, shadows, camera).result()
            opened.callback(lambda thread=thread, screen=screen: thread.submit(screen.close).result())
            every.append((thread, screen))

        def draw(shots: Iterable[Shot]) -> Iterator[Drawn]:
            drawn: deque[Future[Drawn]] = deque()
            for number, shot in enumerate(shots):
                for own, (thread, screen) in enumerate(every):
                    if own == number % len(every):
                        drawn.append(thread.submit(screen.draw, shot.qpos, ghost=shot.ghost, prints=shot.prints))
                    else:
                        thread.submit(screen.follow, shot.qpos)
                if len(drawn) > len(every):
                    yield drawn.popleft().result()
            while drawn:
                yield drawn.popleft().result()

        yield draw


def render(
    model: mujoco.MjModel,
    frames: Iterable[Array | Shot],
    path: Path,
    fps: float = 30.0,
    size: tuple[int, int] = (640, 480),
    shadows: bool = False,
    progress: Callable[[int], None] | None = None,
    camera: Camera = "follow",
) -> int:
    """Films a robot and returns the number of frames; nothing is left behind if it does not come to its end.

    A frame is one qpos (nq,), or more to be drawn. The file is .mp4, of even width and height, or .gif; shadows take
    about twice as long; `progress` is called with the number of frames done. MotiondeckError for another ending, for no
    frames, and where OpenGL or ffmpeg is missing.
    """
    writers = {".mp4": _write_mp4, ".gif": _write_gif}
    if path.suffix.lower() not in writers:
        raise MotiondeckError(f"{path}: a film ends in {' or '.join(writers)}")
    count = 0

    def pictures() -> Iterator[bytes]:
        nonlocal count
        for picture in draw(frame if isinstance(frame, Shot) else Shot(frame) for frame in frames):
            yield picture.tobytes()
            count += 1
            if progress:
                progress(count)

    with _written_whole(path) as unfinished, screens(model, size, shadows, camera) as draw:
        writers[path.suffix.lower()](pictures(), unfinished, fps, size)
        if count == 0:
            raise MotiondeckError(f"{path}: there are no frames to film")
    return count


def contact_sheet(
    rows: Sequence[tuple[str, mujoco.MjModel, Sequence[Array]]], path: Path, tile: tuple[int, int] = (200, 220)
) -> None:
    """Draws one row a motion into one picture of a type that pillow writes: a label, and a model at up to 8 qpos (nq,).

    `tile` is width and height of one picture, pixels. MotiondeckError for no rows, other file types, or without OpenGL.
    """
    if not rows:
        raise MotiondeckError(f"{path}: there are no motions to show")
    if path.suffix.lower() not in Image.registered_extensions():
        raise MotiondeckError(f"{path}: a contact sheet ends in .png, .jpg or .webp")
    kind = Image.registered_extensions()[path.suffix.lower()]
    width, height = tile
    margin = 120
    across = min(FRAMES_A_ROW, max(len(poses) for _, _, poses in rows))
    sheet = Image.new("RGB", (margin + across * width, len(rows) * height), "white")
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
        # A palette of 256 colours: a quarter of the file without a visible difference.
        small = sheet.quantize(256, dither=Image.Dither.NONE) if path.suffix.lower() == ".png" else sheet
        # As an open file: pillow before 11 looks for the name of a path, and this one may have none.
        with unfinished.open("wb") as file:
            small.save(file, kind)


@contextmanager
def _written_whole(path: Path) -> Iterator[Path]:
    """A temporary file that becomes the file on success; a killed process leaves nothing."""
    if not path.parent.is_dir():
        raise MotiondeckError(f"{path}: there is no folder {path.parent}")
    unfinished = path.with_name(f".{path.stem}.unfinished{path.suffix}")
    with MotiondeckError.writing(path):
        nameless = _nameless(path.parent)
        # Find out before minutes of drawing that nothing can be written here.
        unfinished.touch()
        if nameless is not None:
            unfinished.unlink()
    try:
        yield unfinished if nameless is None else Path(f"/proc/{os.getpid()}/fd/{nameless}")
        if nameless is not None:
            folder = os.open(path.parent, os.O_RDONLY)  # with a folder given, Python follows the link
            try:
                os.link(f"/proc/self/fd/{nameless}", unfinished, src_dir_fd=folder, follow_symlinks=True)
            finally:
                os.close(folder)
        unfinished.replace(path)
    except OSError as error:
        raise MotiondeckError.unwritable(path, error) from error
    finally:
        unfinished.unlink(missing_ok=True)
        if nameless is not None:
            os.close(nameless)


def _nameless(folder: Path) -> int | None:
    """An unnamed file in a folder, gone with its process; None where the system has none."""
    try:
        return os.open(folder, os.O_TMPFILE | os.O_RDWR, 0o644)
    except (AttributeError, OSError):
        return None


def _write_mp4(pictures: Iterator[bytes], path: Path, fps: float, size: tuple[int, int]) -> None:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MotiondeckError('a film needs ffmpeg: pip install "motiondeck[video]"') from error
    if size[0] % 2 or size[1] % 2:
        raise MotiondeckError(f"{path}: an mp4 needs an even width and height, not {size[0]} x {size[1]}")
    rate: Any = fps  # ffmpeg takes any number, whatever the annotation says
    writer = imageio_ffmpeg.write_frames(
        str(path),
        size,
        fps=rate,
        quality=8,
        macro_block_size=2,
        ffmpeg_log_level="fatal",  # what else it says is in the error below
        output_params=["-preset", "veryfast", "-f", "mp4"],
    )
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(picture)
    except OSError:  # several lines of ffmpeg's
        full = shutil.disk_usage(path).free < size[0] * size[1]
        raise OSError(errno.ENOSPC, "No space left on device") if full else OSError("ffmpeg has ended") from None
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
    pace = round(1000.0 / fps)
    # As an open file: pillow before 11 looks for the name of a path, and this one may have none.
    with path.open("wb") as file:
        palette.save(file, "GIF", save_all=True, append_images=rest, duration=pace, loop=0, optimize=True)
