"""Drives a rig by the targets of a deck while they are fresh; stops it, within its limits, when they are not.

The guard ticks on its own grid, so that goals leave on time even when targets do not come on time. The grid
follows the targets: it is moved, little by little, to shortly after they usually come. In a tick without new targets,
and in the next, the joints go on as the targets did; then they brake and are held, unless the targets stood still: to
those they come first. Targets that come back before the joints are at rest are caught up with; later ones have to come
to where the joints are held, to be followed from there. So they have to where servos were set up again, which stand
where they were, and after a deck has braked: the joints brake with it at once, wherever they were on their way. Through
ticks that the guard itself has lost the joints go on, if they were few.

The emergency stop is kept here (see `stop_state`): the stop door, the wired stop and the deck demand it, each on its
own. A reset comes from the deck, and names the presses that it releases.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_state import STOP_DOOR, StopState, WiredStop
from motiondeck.run.guard.messages import States, Targets
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from hardware.rig.supervision.board_rig import BoardRig
    from hardware.rig.supervision.rig import Rig

Array = NDArray[np.float64]

MISSED = 2  # ticks without targets in which the joints go on as the targets did
AT = 1e-3  # rad from where joints are held, within which targets are there
# Parts of a tick:
_LATER = 0.02  # by which the grid is moved after targets that came late, so that joints are slower by as much at most
_MARGIN = 0.05  # that targets come before their tick, at least, in _WINDOW ticks
_WINDOW = 50
_SHORTEST = 0.7  # from one tick to the next
DECK = "the deck"


class RigGuard:
    """The joints of a rig between a deck and the bus, tick by tick."""

    def __init__(
        self, rig: "Rig | BoardRig", envelope: SafetyEnvelope, targets: Targets, period: float, now: float
    ) -> None:
        """Holds the joints where the rig holds them; ticks are a period, s, apart, by the machine's steady clock, s."""
        self.stop = StopState("held")  # the state of the emergency stop
        self.wired: WiredStop | None = None  # the wired stop, if there is one
        self.failure = ""  # why the rig has stopped for good, or ""
        self._rig, self._envelope, self._targets = rig, envelope, targets
        self._period, self._grid = period, now + period
        self._came_at, self._ticked_at, self._fresh, self._missed = now, now, False, MISSED
        # The part of a period by which the grid moves in a tick; the shortest wait of targets in the last `_ticks`.
        self._shift, self._least_wait, self._ticks = 0.0, 1.0, 0
        self._latest = [rig.goals.copy() for _ in range(3)]  # the latest targets, the last first
        self._recoveries, self._collected = rig.recoveries, 0
        self._asked_at = self._measured_at = now  # when servos were asked last, and for what was measured last
        self._rests = False  # whether the joints come to rest, whatever targets come
        envelope.start(rig.goals)

    @property
    def at_rest(self) -> bool:
        """Whether the joints have come to rest, and nothing is left to follow."""
        return self._still and self._envelope.at_rest

    @property
    def due(self) -> float:
        """When the next tick is due, s; targets that come change it."""
        if self._fresh and self._still:
            return max(self._came_at, self._ticked_at + _SHORTEST * self._period)
        return self._grid

    def receive(self, now: float) -> None:
        """Takes in what has come with targets: the stop at the deck, and what a reset there has released."""
        self._came_at, self._fresh = now, True
        stop, targets = self.stop, self._targets
        door, wire = targets.released
        stop.pull(DECK, targets.stopped)
        self._rests |= targets.braking
        stop.release({STOP_DOOR: door, DECK: stop.presses.get(DECK, 0)})  # while it is pulled nothing releases it
        if self.wired is not None:
            stop.release({self.wired.name: wire})

    def tick(self, now: float) -> None:
        """One tick, at a time of the machine's steady clock, s."""
        fresh, self._fresh = self._fresh, False
        lost, self._ticked_at = round((now - self._ticked_at) / self._period) - 1, now
        if self.wired is not None:
            self.stop.watch(self.wired)
        fresh = fresh and now - self._targets.sent < MISSED * self._period
        self._move_grid(now, fresh)
        self._make_up(lost)
        if fresh:
            self._take(self._targets.joints)
            self._missed = 0
        else:
            self._missed += 1
        if self.failure:
            return
        try:
            if self._rig.collect_state():
                self._collected += 1
                self._measured_at = self._asked_at
            self._asked_at = now
            self._rig.write(self._next(fresh))
        except MotiondeckError as error:
            self.failure = str(error)

    def press(self, times: int) -> None:
        """Emergency stops at the stop door since the last call."""
        for _ in range(times):
            self.stop.press(STOP_DOOR)

    def end(self) -> None:
        """The deck has sent its last targets, at which its joints are at rest: those that were held up come to them."""
        last, before, first = self._latest
        before[:] = first[:] = last
        self.stop.regain()

    def lose_deck(self) -> None:
        """The deck is gone: nothing is followed any more."""
        self._missed = MISSED
        self.stop.pull(DECK, True)

    def report(self, states: States) -> None:
        """Fills in the state of this tick, but for the servos."""
        wire = self.wired.name if self.wired is not None else ""
        rig = self._rig
        states.set(self.stop, wire, self._collected, rig.recoveries, self._measured_at, rig.busy)

    def _make_up(self, lost: int) -> None:
        """Goes on by the ticks that were not run; a joint whose goal stood still for more of them begins at rest."""
        if lost > MISSED:
            self._envelope.start(self._rig.goals)
            return
        for _ in range(lost):
            self._missed += 1
            self._next(False)

    def _take(self, joints: Array) -> None:
        """Keeps new targets; after missing ones the targets between are on a straight line, or were like these."""
        last, before, first = self._latest
        if self._missed:
            speed = (joints - last) / (self._missed + 1) if self._missed <= MISSED else 0.0
            before[:], first[:] = joints - speed, joints - 2.0 * speed
            last[:] = joints
        else:
            first[:] = joints
            self._latest = [first, last, before]

    @property
    def _is_on_its_way(self) -> bool:
        """Whether joints that were held up are still on their way to targets that stand still."""
        last, before, first = self._latest
        stand = np.array_equal(last, before) and np.array_equal(before, first)
        return stand and bool(np.any(np.abs(last - self._envelope.position) > AT))

    @property
    def _still(self) -> bool:
        return self.stop.phase in ("held", "latched")

    def _move_grid(self, now: float, fresh: bool) -> None:
        """Sets the time of the next tick, a period on, and moves it towards when targets come."""
        shift, waited = self._shift, (now - self._came_at) / self._period
        if self._still and fresh:
            self._grid, shift = now + _MARGIN * self._period, 0.0
        elif not fresh:
            self._least_wait, shift = 0.0, _LATER if self._missed <= MISSED else 0.0
        self._least_wait = min(self._least_wait, waited)
        self._ticks += 1
        if self._ticks == _WINDOW:
            # Half of what all targets of the window came too early, in the course of the next.
            self._shift = -0.5 * max(0.0, self._least_wait - _MARGIN) / _WINDOW
            self._ticks, self._least_wait = 0, 1.0
        self._grid += (1.0 + shift) * self._period
        if self._grid < now + _SHORTEST * self._period:  # the guard itself was late
            self._grid = now + self._period

    def _next(self, fresh: bool) -> Array:
        stop, envelope = self.stop, self._envelope
        if self._rig.recoveries != self._recoveries:
            # Joints that were set up again begin where they stand. The others brake, and the deck comes to all of them.
            self._recoveries, self._rests = self._rig.recoveries, True
            envelope.restart(np.abs(self._rig.goals - envelope.position) > AT, self._rig.goals)
        if self._rests or (self._missed > MISSED and not self._is_on_its_way):
            stop.lose()
        elif fresh:
            stop.regain()
        last, before, first = self._latest
        if stop.phase == "held" and fresh and not self._rests and np.all(np.abs(last - envelope.position) < AT):
            stop.go_on()
            before[:] = first[:] = last
        if stop.phase == "running":
            if fresh:
                return envelope(last)
            n, speed, change = self._missed, last - before, last - 2.0 * before + first
            return envelope(last + n * speed + 0.5 * n * (n + 1) * change)
        goals = envelope.brake()
        if envelope.at_rest:
            stop.rested()
            self._rests = False
        return goals
