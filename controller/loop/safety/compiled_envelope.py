"""The safety envelope in C (`envelope.c`), where a compiler was there when this was installed; else its twin in Python.

The compiled part is taken if it was made from the very source beside it and does as its twin in a trial, to the last
bit. In any doubt it is not: the twin does the same, and takes some tens of microseconds longer.
"""

import ctypes
import zlib
from functools import cache, partial
from pathlib import Path

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array

SOURCE = Path(__file__).with_name("envelope.c")
COMPILED = SOURCE.with_suffix(".so")
_TRIAL = 60  # ticks


def safety_envelope(limits: JointLimits, dt: float) -> SafetyEnvelope:
    """The envelope for ticks of dt seconds, compiled if it can be; LimitError as of `check_limits`."""
    library = load_compiled(COMPILED)
    return SafetyEnvelope(limits, dt) if library is None else CompiledEnvelope(library, limits, dt)


class CompiledEnvelope(SafetyEnvelope):
    """A `SafetyEnvelope` whose ticks a library computes."""

    def __init__(self, library: ctypes.CDLL, limits: JointLimits, dt: float) -> None:
        super().__init__(limits, dt)
        self._states = states = np.array(self._states)
        self._limits, self._targets = np.array(self._bounds), np.empty(len(states))
        *fixed, targets = (ctypes.c_void_p(x.ctypes.data) for x in (self._limits, states, self._safe, self._targets))
        self._brake = partial(library.envelope_brake, len(states), *fixed)
        self._tick = partial(library.envelope_tick, len(states), *fixed, targets)

    def __call__(self, targets: Array, near: bool = False) -> Array:
        """As of the twin."""
        if targets.shape != self._targets.shape:
            raise ValueError(f"targets of shape {targets.shape} instead of {self._targets.shape}")
        self._targets[:] = targets
        self._tick(ctypes.c_void_p(self.changed.buffer_info()[0]), near)
        return self._shown

    def brake(self) -> Array:
        """As of the twin."""
        self._brake()
        return self._shown


@cache
def load_compiled(path: Path) -> ctypes.CDLL | None:
    """The compiled part; None if there is none, it was made from another source, or does not do as its twin."""
    try:
        library = ctypes.PyDLL(str(path))  # it keeps Python's lock, which may take milliseconds to come back
        made_from = ctypes.c_uint32.in_dll(library, "envelope_source").value
        return library if made_from == zlib.crc32(SOURCE.read_bytes()) and _does_as_its_twin(library) else None
    except (OSError, AttributeError, ValueError):
        return None


def unfit() -> list[str]:
    """A line with the remedy if there is a compiled part that is not used, as after a change of its source."""
    line = "the compiled safety envelope is not of this source: ticks are slower. pip install -e . compiles it anew"
    return [line] * (COMPILED.exists() and load_compiled(COMPILED) is None)


def _does_as_its_twin(library: ctypes.CDLL) -> bool:
    """A trial of 6 joints, slow to fast, whose targets wave, jump and are no numbers, and of braking."""
    lower, pace = np.linspace(-2.0, -0.5, 6), np.geomspace(0.05, 5.0, 6)
    limits = JointLimits(lower, lower + 1.5 * pace, 6.0 * pace, 60.0 * pace**2, 2000.0 * pace**3)
    twins = SafetyEnvelope(limits, 0.005), CompiledEnvelope(library, limits, 0.005)
    time = np.arange(_TRIAL)[:, None]
    targets = np.where(time % 40 < 20, np.sin(0.1 * pace * time), np.sin(1e4 * pace * time))
    targets[29::30] = np.nan, np.inf, -np.inf, 1e300, -1e300, 0.0
    for tick, target in enumerate(targets):
        for one in twins:
            one.brake() if tick % 25 > 20 else one(target, tick > _TRIAL // 2)
        ours, theirs = (one._shown.tobytes() + np.array(one._states).tobytes() for one in twins)
        if ours != theirs:
            return False
    return twins[0].changed == twins[1].changed
