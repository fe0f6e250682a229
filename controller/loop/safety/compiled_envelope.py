"""The safety envelope in C (`envelope.c`), where a compiler was there when this was installed; else its twin in Python.

The compiled part is taken if it was made from the very source beside it and does as its twin in a trial, to the last
bit. In any doubt it is not: the twin does the same, and takes some tens of microseconds longer.
"""

import ctypes
import zlib
from array import array
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
    """A `SafetyEnvelope` whose ticks are computed by a library."""

    def __init__(self, library: ctypes.CDLL, limits: JointLimits, dt: float) -> None:
        super().__init__(limits, dt)
        self._states = self._rows = np.array(self._states)
        self._limits, self._targets = np.array(self._bounds), np.empty(len(self._bounds))
        self._library = library
        self.count_in(self.changed)

    def count_in(self, changed: "array[int]") -> None:
        """Counts changed targets there from now on."""
        super().count_in(changed)
        fixed = len(changed), _pointer(self._limits), _pointer(self._rows)
        safe = _pointer(self._safe)
        counts = ctypes.c_void_p(changed.buffer_info()[0])
        self._tick = partial(self._library.envelope_tick, *fixed, _pointer(self._targets), safe, counts)
        self._brake = partial(self._library.envelope_brake, *fixed, safe)

    def __call__(self, targets: Array, near: bool = False) -> Array:
        """As of the twin."""
        if targets.shape != self._targets.shape:
            raise ValueError(f"targets of shape {targets.shape} instead of {self._targets.shape}")
        self._targets[:] = targets
        self._tick(near)
        return self._shown

    def brake(self) -> Array:
        """As of the twin."""
        self._brake()
        return self._shown


@cache
def load_compiled(path: Path) -> ctypes.CDLL | None:
    """The compiled part; None if there is none, it was made from another source, or does not do as its twin."""
    try:
        # It keeps Python's lock: a call takes microseconds, and to have the lock back may take milliseconds.
        library = ctypes.PyDLL(str(path))
        made_from = ctypes.c_uint32.in_dll(library, "envelope_source").value
        same = made_from == zlib.crc32(SOURCE.read_bytes()) and _does_as_its_twin(library)
    except (OSError, AttributeError, ValueError):
        return None
    return library if same else None


def _does_as_its_twin(library: ctypes.CDLL) -> bool:
    """A trial of 6 joints, slow to fast, whose targets wave, jump and are no numbers, and of braking."""
    lower, pace = np.linspace(-2.0, -0.5, 6), np.geomspace(0.05, 5.0, 6)
    limits = JointLimits(lower, lower + 1.5 * pace, 6.0 * pace, 60.0 * pace**2, 2000.0 * pace**3)
    twin, compiled = SafetyEnvelope(limits, 0.005), CompiledEnvelope(library, limits, 0.005)
    time = np.arange(_TRIAL)[:, None]
    targets = np.where(time % 40 < 20, np.sin(0.1 * pace * time), np.sin(1e4 * pace * time))
    targets[time[:, 0] % 30 == 29] = np.nan, np.inf, -np.inf, 1e300, -1e300, 0.0
    for tick, target in enumerate(targets):
        for one in (twin, compiled):
            one.brake() if tick % 25 > 20 else one(target, tick > _TRIAL // 2)
        if np.array(twin._states).tobytes() != np.array(compiled._states).tobytes():
            return False
    return twin.changed == compiled.changed and compiled.position.tobytes() == compiled._shown.tobytes()


def _pointer(values: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)
