"""Draws the frames of a film on several screens in parallel, one thread each.

OpenGL in software does most of its work on one core; two screens on two cores halve the time of a film.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass

import mujoco

from controller.motion.rotations import Array
from motiondeck.pictures.offscreen import Camera, Image, OffScreen

MOST = 4


@dataclass(frozen=True)
class Shot:
    """One picture of a film."""

    qpos: Array  # the robot, shape (nq,)
    ghost: Array | None = None  # the robot drawn translucent as well, shape (nq,)
    prints: Sequence[Array] = ()  # corners of footprints on the floor, shape (4, 3) each, m


class Screens:
    """One screen per core of this process, up to MOST; a context manager.

    Args:
        model, size, shadows, camera: as for OffScreen.

    Raises:
        PictureError: where there is no off-screen OpenGL, or the size does not fit.
    """

    def __init__(self, model: mujoco.MjModel, size: tuple[int, int], shadows: bool, camera: Camera) -> None:
        from joblib import cpu_count  # slow to import

        self._open = ExitStack()
        self._screens: list[OffScreen] = []
        self._threads: list[ThreadPoolExecutor] = []
        try:
            for _ in range(min(cpu_count(), MOST)):
                # OpenGL wants a context to be used, and freed, in the thread that made it.
                thread = self._open.enter_context(ThreadPoolExecutor(1))
                screen = thread.submit(OffScreen, model, size, shadows, camera).result()
                self._open.callback(lambda thread=thread, screen=screen: thread.submit(screen.close).result())
                self._threads.append(thread)
                self._screens.append(screen)
        except BaseException:
            self._open.close()
            raise

    def __call__(self, shots: Iterable[Shot]) -> Iterator[Image]:
        """The pictures, in order."""
        drawn: deque[Future[Image]] = deque()
        for number, shot in enumerate(shots):
            mine = number % len(self._screens)
            for own, (thread, screen) in enumerate(zip(self._threads, self._screens, strict=True)):
                if own == mine:
                    drawn.append(thread.submit(screen.draw, shot.qpos, ghost=shot.ghost, prints=shot.prints))
                else:
                    thread.submit(screen.follow, shot.qpos)
            if len(drawn) > len(self._screens):
                yield drawn.popleft().result()
        while drawn:
            yield drawn.popleft().result()

    def __enter__(self) -> Screens:
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()
