"""Deck and guard keep the emergency stop together: every order of presses, ticks, lost datagrams and resets, explored.

The deck's part is the one of a session with a guarded rig; the guard is the real one with a rig that only notes whether
it was moved. A judge of its own remembers which stops stand.
"""

from copy import deepcopy

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controller.loop.stop_state import STOP_DOOR, EmergencyStopError, StopState
from motiondeck.run.guard.guard import RigGuard
from motiondeck.run.guard.messages import States, Targets

T = 0.01
EVENTS = (
    "press at the deck",
    "press at the door",
    "deck ticks",
    "deck ticks, its targets are lost",
    "its targets come twice",
    "guard ticks",
    "guard ticks, its state is lost",
    "reset",
    "play",
)


class Joint:
    """An envelope of one joint that needs two ticks to come to rest."""

    def __init__(self):
        self.position, self.left = np.zeros(1), 0

    def start(self, position):
        self.position, self.left = position.copy(), 0

    @property
    def at_rest(self):
        return self.left == 0

    def __call__(self, targets):
        self.position, self.left = targets.copy(), 2
        return self.position

    def brake(self):
        self.left = max(0, self.left - 1)
        return self.position


class Rig:
    goals, recoveries, busy = np.zeros(1), 0, 0.0

    def collect_state(self):
        return False

    def write(self, targets):
        pass


class Pair:
    """Deck and guard, what is on its way between them, and the judge's memory."""

    def __init__(self):
        self.now = 1.0
        self.targets, self.states = Targets(1), States(1)
        self.joint = Joint()
        self.guard = RigGuard(Rig(), self.joint, self.targets, T, self.now)
        self.stop = StopState()
        self.deck_rests = 0
        self.door_pressed = self.door_released = 0  # as the judge counts
        self.deck_stopped = self.guard_heard_it = False
        for event in ("guard ticks", "deck ticks", "guard ticks", "deck ticks", "guard ticks"):
            self.happen(event)
        assert self.guard.stop.phase == "running"

    def happen(self, event):
        following = self.guard.stop.phase == "running"
        match event:
            case "press at the deck":
                self.stop.press("command")
                self.deck_stopped, self.guard_heard_it = True, False
            case "press at the door":
                self.guard.press(1)
                self.door_pressed += 1
            case "deck ticks":
                self.deck_ticks()
                self.guard.receive(self.now)
                self.guard_heard_it = self.deck_stopped
            case "deck ticks, its targets are lost":
                before = self.targets.values.copy()
                self.deck_ticks()
                self.targets.values[:] = before
            case "its targets come twice":
                self.guard.receive(self.now)
            case "guard ticks" | "guard ticks, its state is lost":
                self.now += T
                self.guard.tick(self.now)
                if not event.endswith("lost"):
                    self.guard.report(self.states)
            case "reset":
                seen = self.states.presses[0]
                try:
                    self.stop.reset()
                except EmergencyStopError:
                    pass
                else:
                    self.deck_stopped = False
                    self.door_released = seen
            case "play":
                if not self.stop.stopped:
                    self.stop.go_on()
        self.judge(event, following)

    def deck_ticks(self):
        """As a session does: the presses of the guard's door, the phase of the joints, the targets."""
        stop = self.stop
        stop.count(STOP_DOOR, self.states.presses[0])
        if stop.phase == "braking":
            self.deck_rests += 1
            if self.deck_rests == 2:
                stop.rested()
        else:
            self.deck_rests = 0
        self.targets.set(self.now, stop.stopped, stop.phase == "braking", stop.released.get(STOP_DOOR, 0), 0)
        moves = stop.phase == "running" and self.states.phase == "running"
        self.targets.joints[:] = self.joint.position + (0.5 if moves else 0.0)

    def judge(self, event, following):
        follows = self.guard.stop.phase == "running"
        if self.door_pressed > self.door_released:
            assert not follows, f"{event}: the joints follow while a press at the door stands"
        if self.deck_stopped and self.guard_heard_it:
            assert not follows, f"{event}: the joints follow while the deck's stop stands"
        if follows and not following:
            assert not (self.stop.stopped and self.guard_heard_it)

    @property
    def key(self):
        guard, stop = self.guard.stop, self.stop
        ahead = self.door_pressed - self.states.presses[0], self.door_pressed - self.door_released
        told = self.door_pressed - self.targets.released[0], self.targets.stopped
        own = stop.presses.get("command", 0) - stop.released.get("command", 0)
        return (
            *(guard.phase, stop.phase, self.joint.left, self.deck_rests, *ahead, *told, own > 0),
            *(self.deck_stopped, self.guard_heard_it, self.guard.due <= self.now, self.states.phase),
        )


def test_in_no_order_of_events_do_the_joints_follow_while_a_stop_stands():
    seen, edge = set(), [Pair()]
    for _ in range(9):
        after = []
        for pair in edge:
            for event in EVENTS:
                other = deepcopy(pair)
                other.happen(event)
                if other.door_pressed <= 3 and other.key not in seen:
                    seen.add(other.key)
                    after.append(other)
        edge = after
    assert len(seen) > 300


@given(st.lists(st.sampled_from(EVENTS), max_size=120))
def test_in_long_random_orders_neither_and_a_reset_and_play_get_it_going_again(events):
    pair = Pair()
    for event in events:
        pair.happen(event)
    for event in ("deck ticks", "guard ticks") * 4 + ("reset", "play") + ("deck ticks", "guard ticks") * 4:
        pair.happen(event)
    assert pair.guard.stop.phase == "running"
