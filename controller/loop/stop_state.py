"""The emergency stop as a state: which sources demand it, how far the joints are, and what lets them go on.

    running   the joints follow what is played
    braking   they come to rest, because a source demands it or there is nothing left to follow
    latched   at rest, and a source demands it still
    held      at rest, and no source demands it: until they are let go on

    press, pull   running to braking, held to latched
    lose          running to braking; regain leads back, if no source demands the stop
    rested        braking to latched, or to held if no source demands the stop
    reset         latched to held
    go on         held to running

A source counts its presses, and a reset releases those that it has seen: neither a press that comes twice nor one that
crosses a reset on its way can be taken for another. A pulled wire cannot be reset before it is let go.
"""

from collections.abc import Mapping
from typing import Literal, Protocol

from motiondeck_base.errors import MotiondeckError

Phase = Literal["running", "braking", "latched", "held"]

STOP_DOOR = "stop door"  # a source; a wired stop has the name of its device


class WiredStop(Protocol):
    """An emergency stop that is wired: the name of its device, whether it is pulled now, and how often it was."""

    name: str
    pulled: bool
    pulls: int


class EmergencyStopError(MotiondeckError):
    """A command that the present emergency-stop state does not allow."""


class StopState:
    """The stop state of joints; each source is a name."""

    def __init__(self, phase: Phase = "running") -> None:
        self.phase: Phase = phase
        self.presses: dict[str, int] = {}  # the presses of each source since the start
        self.total = 0  # of all sources
        self.released: dict[str, int] = {}  # how many of them resets have released
        self.pulled: set[str] = set()  # sources that are pulled now: no reset releases them

    @property
    def demanded(self) -> bool:
        """Whether any source demands the stop."""
        released = self.released
        return any(count > released.get(name, 0) for name, count in self.presses.items())

    @property
    def stopped(self) -> bool:
        """Whether the emergency stop is on: the joints brake for it, or are latched."""
        return self.phase == "latched" or (self.phase == "braking" and self.demanded)

    def press(self, source: str) -> None:
        """One press of a source."""
        self.count(source, self.presses.get(source, 0) + 1)

    def count(self, source: str, presses: int) -> None:
        """Takes in how often a source was pressed by its own count, which never falls; fewer are an old report."""
        if presses > self.presses.get(source, 0):
            self.presses[source] = presses
            self.total = sum(self.presses.values())
            self.phase = "latched" if self.phase in ("held", "latched") else "braking"

    def pull(self, source: str, pulled: bool) -> None:
        """A source that demands the stop as long as it is pulled, and until a reset after that."""
        if not pulled:
            self.pulled.discard(source)
        elif source not in self.pulled:
            self.pulled.add(source)
            self.count(source, self.released.get(source, 0) + 1)

    def watch(self, wired: WiredStop) -> None:
        """Takes in what a wired stop does now; it is asked again and again."""
        self.count(wired.name, wired.pulls)
        self.pull(wired.name, wired.pulled)

    def lose(self) -> None:
        """There is nothing to follow: the joints brake, as far as they move."""
        if self.phase == "running":
            self.phase = "braking"

    def regain(self) -> None:
        """There is something to follow again: joints that still brake for its loss follow it."""
        if self.phase == "braking" and not self.demanded:
            self.phase = "running"

    def rested(self) -> None:
        """The joints have come to rest."""
        if self.phase == "braking":
            self.phase = "latched" if self.demanded else "held"

    def reset(self) -> None:
        """Releases all presses so far; EmergencyStopError if it is off, joints are not at rest, or a wire is pulled."""
        if not self.stopped:
            raise EmergencyStopError("the emergency stop is not on, so there is nothing to reset")
        if self.phase == "braking":
            raise EmergencyStopError("the joints are still braking; reset the emergency stop when they are at rest")
        for source in sorted(self.pulled):
            raise EmergencyStopError(f"the emergency stop at {source} is still pulled: let it go, then reset")
        self.release(self.presses)

    def release(self, seen: Mapping[str, int]) -> None:
        """Releases the presses that a reset has seen, for each source its count; others go on demanding the stop."""
        for source, count in seen.items():
            if source in self.pulled:
                continue
            self.released[source] = max(self.released.get(source, 0), min(count, self.presses.get(source, 0)))
        if self.phase == "latched" and not self.demanded:
            self.phase = "held"

    def go_on(self) -> None:
        """Lets held joints move again; EmergencyStopError if the emergency stop is on."""
        self.check_released()
        if self.phase == "held":
            self.phase = "running"

    def check_released(self) -> None:
        """Checks that the joints may be moved; raises an EmergencyStopError if the emergency stop is on."""
        if self.stopped:
            raise EmergencyStopError("the emergency stop is on; release it with: reset")
