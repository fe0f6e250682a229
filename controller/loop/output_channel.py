"""A channel: one output of the loop, the ticks in which it is served, and its faults."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVarTuple

import numpy as np

from controller.deck.interfaces import Output
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck_base.errors import in_words

FAULTS_TO_PARK = 3  # an output whose turns fail so often in a row is parked: it is no longer served


@dataclass
class Channel:
    """Serves an output at each `every`-th tick; its exceptions are counted and not passed on."""

    output: Output
    every: int = 1  # 1 for each tick, 2 for each second tick, and so on
    # The joint positions read last, shape (J,), rad, or None; NaN for a joint that is not measured.
    measured: Array | None = field(default=None, init=False)
    # Where the output holds joints on its own, shape (J,), rad, NaN for others; None while it follows. It follows again
    # once its targets are there.
    held: Array | None = field(default=None, init=False)
    faults: int = field(default=0, init=False)
    fault: str = field(default="", init=False)
    parked: bool = field(default=False, init=False)  # whether the output is no longer served
    _failed: bool = field(default=False, init=False)
    _failed_turns: int = field(default=0, init=False)
    _prefix: str = field(default="", init=False)
    # Of one of several robots: its joints among all J; measured and held positions (J,), rad, NaN for other joints.
    _shared: tuple[slice, Array, Array] | None = field(default=None, init=False)

    def share(self, first: int, joints: int, of: int, prefix: str = "") -> None:
        """Gives the output the joints of one of several robots, from the `first` of all on; a prefix tells it apart."""
        self._prefix = prefix
        self._shared = slice(first, first + joints), np.full(of, np.nan), np.full(of, np.nan)

    @property
    def name(self) -> str:
        """The name of the output."""
        return self._prefix + self.output.name

    @property
    def lag(self) -> Array | None:
        """How long after a write each joint is there, shape (J,), s; None for an output that says nothing of it."""
        lag: Array | None = getattr(self.output, "lag", None)
        if self._shared is None:
            return lag
        own, measured, _ = self._shared
        return _placed(lag, own, np.zeros(len(measured)))

    @property
    def corrected(self) -> bool:
        """Whether the output gets corrected targets, since its joints teach a correction."""
        return getattr(self.output, "correction", None) is not None

    @property
    def at_rest(self) -> bool:
        """Whether an output that brakes joints on its own holds them."""
        return self.parked or getattr(self.output, "at_rest", True)

    def read(self, tick: int) -> None:
        """Reads the joint positions, if it is the output's turn."""
        if self.parked or tick % self.every:
            return
        try:
            measured, held = self.output.measured(), getattr(self.output, "held", None)
            places = held() if held is not None else None
            if self._shared is not None:
                own, of_measured, of_places = self._shared
                measured, places = _placed(measured, own, of_measured), _placed(places, own, of_places)
            self.measured, self.held = measured, places
        except Exception as error:
            self._count(error)

    def write(self, tick: int, targets: Array, pose: Pose) -> None:
        """Writes the targets, if it is the output's turn, and parks the output after too many failed turns."""
        if self.parked or tick % self.every:
            return
        try:
            self.output.write(targets if self._shared is None else targets[self._shared[0]], pose)
        except Exception as error:
            self._count(error)
        self._failed_turns = self._failed_turns + 1 if self._failed else 0
        self._failed = False
        self.parked = self._failed_turns >= FAULTS_TO_PARK
        if self.parked:
            self.held = None

    def report(self) -> dict[str, object]:
        """The output's own report with its name and whether it was parked; `faults` is the sum of both counts."""
        try:
            own = dict(self.output.report())
        except Exception as error:
            self._count(error)
            own = {}
        inner = own.pop("faults", 0)
        faults = self.faults + (inner if isinstance(inner, int) else 0)
        last = {"fault": self.fault} if self.fault else {}
        return {"name": self.name, "faults": faults, "parked": self.parked, **last, **own}

    def _count(self, error: Exception) -> None:
        self._failed = True
        self.faults += 1
        self.fault = in_words(error)


def _placed(own: Array | None, at: slice, among: Array) -> Array | None:
    """The values of some joints among those of all, which they are written into; None for none."""
    if own is None:
        return None
    among[at] = own
    return among


Args = TypeVarTuple("Args")
FAULTS_TO_GIVE_UP = 20


@dataclass
class FaultCounter:
    """The faults of one kind of call."""

    faults: int = 0
    fault: str = ""
    given_up: bool = False  # whether the last `most` calls have all raised; no further one is made
    most: int = FAULTS_TO_GIVE_UP
    in_a_row: int = 0

    def call(self, action: Callable[[*Args], None], *args: *Args) -> None:
        """Calls the action and counts what it raises, unless given up."""
        if self.given_up:
            return
        try:
            action(*args)
            self.in_a_row = 0
        except Exception as error:
            self.count(error)

    def count(self, error: Exception) -> None:
        """Counts what a call has raised."""
        self.faults += 1
        self.in_a_row += 1
        self.given_up = self.in_a_row >= self.most
        self.fault = in_words(error)
