"""An empty loop in C, as a program that is compiled when it is needed."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.loop.permissions import FIFO_PRIORITY
from controller.motion.rotations import Array


@dataclass(frozen=True)
class CLoop:
    """The compiled program; it is removed with the last reference to it."""

    _folder: tempfile.TemporaryDirectory[str]

    @classmethod
    def compiled(cls) -> CLoop | None:
        """Compiles `_c_loop.c`; None without a C compiler."""
        compiler = shutil.which("cc")
        if compiler is None:
            return None
        loop = cls(tempfile.TemporaryDirectory())
        source = Path(__file__).with_name("_c_loop.c")
        subprocess.run([compiler, "-O2", "-o", loop._program, source], check=True)
        return loop

    @property
    def _program(self) -> Path:
        return Path(self._folder.name) / "c_loop"

    def __call__(self, rate: float, ticks: int, *, fifo: bool) -> Array:
        """By how much each tick at a rate (Hz) was late, shape (ticks,), us."""
        arguments = (round(1e9 / rate), ticks, FIFO_PRIORITY if fifo else 0)
        command = [str(self._program), *map(str, arguments)]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return 1e-3 * np.array(said.split(), float)
