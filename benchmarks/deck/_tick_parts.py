"""Where the time of a tick of `play` goes: each part with what it calls, less what the parts within it take."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import getattr_static
from typing import Any

import numpy as np

import controller.motion.encodings.bone_directions as bone_directions
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.deck.tracks.frame_player import FramePlayer
from controller.loop.clock import Ticker
from controller.loop.output_channel import Channel
from controller.loop.safety.compiled_envelope import CompiledEnvelope
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.rotations import Array
from motiondeck.run.session import Session
from sim.physics.playback import PhysicsPlayback
from sim.physics.simulated_servos import Servos
from sim.retargeting.footing import BakedRoot, Footing
from sim.retargeting.human_stance import HumanStance
from sim.retargeting.retarget import LimbAngles, ServoHumanoidRetargeter

PARTS: dict[str, tuple[tuple[Any, str], ...]] = {
    "commands": ((Session, "_carry_out_commands"),),
    "network": ((FramePlayer, "step"),),
    "rotations of the bones": ((bone_directions, "orient"),),
    "rest of the deck": ((Deck, "update"),),
    "angles of the limbs": ((LimbAngles, "__call__"),),
    "rest of retargeting": ((ServoHumanoidRetargeter, "__call__"), (JointRetargeter, "__call__")),
    "safety envelope": ((SafetyEnvelope, "__call__"), (CompiledEnvelope, "__call__")),
    "stance of the human": ((HumanStance, "__call__"),),
    "footing of the robot": ((Footing, "place"), (BakedRoot, "place")),
    "mj_step, twice": ((PhysicsPlayback, "step"),),
    "simulated servos": ((Servos, "step"),),
    "rest of the simulation": ((PhysicsPlayback, "write"),),
    "outputs (the rig, if there is one)": ((Channel, "read"), (Channel, "write")),
}
REST, ALL = "rest of the loop", "all"

Calls = tuple[tuple[Any, str], ...]


class Ticks:
    """Times the ticks of a loop that a clock drives.

    Args:
        clock: gets a `wait` of its own.
        between: called with the number of each tick that has ended; what it takes is not counted.

    Attributes:
        rows: of each tick its parts by name, and ALL, us.
    """

    def __init__(self, clock: Ticker | VirtualClock, between: Callable[[int], None] | None = None) -> None:
        self.rows: list[dict[str, float]] = []
        self._parts: defaultdict[str, int] = defaultdict(int)
        self._inner = [0]
        self._began = 0
        wait = clock.wait

        def timed() -> int:
            spent = time.perf_counter_ns() - self._began
            row = {name: 1e-3 * ns for name, ns in self._parts.items()}
            self.rows.append(row | {REST: 1e-3 * (spent - self._inner[0]), ALL: 1e-3 * spent})
            self._parts.clear()
            if between is not None:
                between(len(self.rows))
            late = wait()
            self._inner = [0]
            self._began = time.perf_counter_ns()
            return late

        clock.wait = timed

    @contextmanager
    def of_parts(self) -> Iterator[None]:
        """Times PARTS while the block runs."""
        before = [(owner, name, getattr_static(owner, name)) for calls in PARTS.values() for owner, name in calls]
        try:
            for part, calls in PARTS.items():
                for owner, name in calls:
                    static = isinstance(getattr_static(owner, name), staticmethod)
                    timed = self._timed(part, getattr(owner, name))
                    setattr(owner, name, staticmethod(timed) if static else timed)
            yield
        finally:
            for owner, name, call in before:
                setattr(owner, name, call)

    def _timed(self, part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(call)
        def timed(*args: Any, **kwargs: Any) -> Any:
            began = time.perf_counter_ns()
            self._inner.append(0)
            try:
                return call(*args, **kwargs)
            finally:
                spent = time.perf_counter_ns() - began
                self._parts[part] += spent - self._inner.pop()
                self._inner[-1] += spent

        return timed

    def column(self, part: str, ticks: slice) -> Array:
        """What a part took in some of the ticks, shape (ticks,), us."""
        return np.array([row.get(part, 0.0) for row in self.rows[ticks]])
