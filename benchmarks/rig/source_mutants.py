"""Breakages of the rig's source, of which fault schedules must notice each."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FunctionType
from typing import NamedTuple, cast

from hardware.rig.driving.joined import JoinedMeasurements
from hardware.rig.driving.servo_port import ServoPort
from hardware.rig.rig_file import RigJoint
from hardware.rig.supervision.health import Health
from hardware.rig.supervision.pace import CatchingUp, JointPace, Strain
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.audit import _needs, current_counts
from hardware.rig.switching.identities import check_identities
from hardware.rig.switching.torque import (
    _await_partners,
    _keep_goals_near,
    _limit_speed,
    hold_still,
    places_of_rest,
    speed_counts,
)
from hardware.rig.switching.turns import _whole_turns, way


class Mutant(NamedTuple):
    """A function of which one piece of text is replaced, and the fault and the kind of joint that it is about."""

    function: Callable[..., object]
    text: str
    instead: str
    about: tuple[str, str] | tuple[str, str, bool] = ("", "")  # as in `strikes`
    cure: str = ""  # the mutant that takes away what else would mend it in time; on its own it is no find


def _getter(kind: type, name: str) -> Callable[..., object]:
    """The function behind a property."""
    return cast(Callable[..., object], cast(property, vars(kind)[name]).fget)


_GOALS = 'write_each(config, bus, "goal_position", [int(pulses) for pulses in scale.pulses(goals)])'

_PAIR = "two servos on a joint"

MUTANTS = {
    "no clipping": Mutant(JointPace.bound, "self._scale.within(targets)", "targets"),
    "no goal := present": Mutant(hold_still, _GOALS, "pass", cure="torque beside a swing"),
    "torque beside a swing": Mutant(_keep_goals_near, ".max() < _OFF", ".max() < 99.0", ("reboot", "a weight")),
    "no braking distance": Mutant(places_of_rest, "np.where(moves | stands, np.clip(ahead, -most, most), 0.0)", "0.0"),
    "no acceleration limit": Mutant(
        _limit_speed, '"profile_acceleration", rates', '"profile_acceleration", [0] * len(rates)'
    ),
    "no speed limit": Mutant(
        speed_counts, 'in_counts(joint, "profile_velocity", joint.velocity * joint.gear * pace)', "0"
    ),
    "full-speed catch-up": Mutant(
        _getter(CatchingUp, "pace"),
        "np.where(self.joints, SLOWER, 1.0)",
        "np.ones(len(self.joints))",
    ),
    "another's speed kept": Mutant(
        ServoPort.write, "data = self._speed_frames(silent) + data", "pass", ("duplicate", "")
    ),
    "no watchdog": Mutant(ServoPort.write, '"bus_watchdog", self.part.watchdog_units)', '"bus_watchdog", 0)'),
    "no identity check": Mutant(check_identities, "identity.model != joint.model", "False"),
    "no switch-off": Mutant(ServoPort.close, "end(self.servos, self.bus)", "[]"),
    "mode without a limit of current": Mutant(_getter(RigJoint, "mode"), "limited[0]", "POSITION_MODE"),
    "goal := present under load": Mutant(places_of_rest, "np.where(moves | stands,", "np.where(moves,"),
    "gains overwritten": Mutant(_needs, 'yield name, default, "kept"', 'yield name, default, "switch-on"'),
    "own gains not set": Mutant(
        _needs, 'yield name, joint.gains[name], "switch-on"', 'yield name, joint.gains[name], "kept"'
    ),
    "a third more current": Mutant(current_counts, "joint.current) if", "1.3 * joint.current) if"),
    "no turn for a range across zero": Mutant(
        _whole_turns, "return joint.whole_turns(pulses)", "return 0", ("", "a range across the horn's zero")
    ),
    "turn of the rig file": Mutant(_whole_turns, "return round(turns) * per_turn", "return 0", ("", "several turns")),
    "restart between readings": Mutant(
        hold_still, "_refuse_other_turns(config, positions, believed)", "pass", ("reboot", "several turns")
    ),
    "gripper that yields": Mutant(Strain.__init__, "math.inf if joint.grip else", "", ("jam", "a gripper")),
    "gripper that lets go": Mutant(places_of_rest, "joint.grip for", "False for", ("jam", "a gripper")),
    "old place of one of two": Mutant(JoinedMeasurements.update, "joints.torque & (count", "(count", ("reboot", _PAIR)),
    "times of two unlike": Mutant(
        JoinedMeasurements.update,
        "positions, firsts) - moved",
        "positions, firsts)",
        ("", "two servos that are read one after the other"),
    ),
    "one of two goes on alone": Mutant(
        Rig._held_back, "np.where(self._joined.waits, stay, targets)", "targets", ("duplicate", _PAIR)
    ),
    "caught up while it waits": Mutant(JointPace.sent, " | held", "", ("swap", _PAIR)),
    "torque beside a moving partner": Mutant(
        _await_partners, "partners += own", "pass", ("reboot", _PAIR, True), "paths that part"
    ),
    "one of two fights without a path": Mutant(
        _await_partners, "pair <= kept and not shown[one] and", "False and", ("duplicate", "two servos without a path")
    ),
    "turn by the goal alone": Mutant(way, "0.5 * (ends[0] + ends[-1])", "ends[-1]", ("brownout", "several turns")),
    "path of one of two astray": Mutant(_await_partners, "> APART):", "> 9.0):", ("duplicate", _PAIR)),
    "one of two leaps back": Mutant(_await_partners, "> APART for", "> 9.0 for", ("duplicate", _PAIR)),
    "goals run away from a silent joint": Mutant(
        Rig._held_back,
        "unseen &= self._several",
        "unseen &= False",
        ("duplicate", "several turns"),
        "turn by the goal alone",
    ),
    "goal taken for a path": Mutant(
        places_of_rest, "np.where(away, angles, path)", "path", ("", "a limit of acceleration, and no path shown")
    ),
    "goal given up in a silence": Mutant(JoinedMeasurements.update, "waits & moved &", "waits &", ("drop", _PAIR)),
    "strain kept at a recovery": Mutant(
        JointPace.start_again, "self.strain.forget(joints)", "pass", ("duplicate", _PAIR)
    ),
    "pull at one out of reach": Mutant(Rig._look_after, "measured.alone", "False", ("duplicate", _PAIR)),
    "paths that part": Mutant(
        Health.look, "(back | limp | idle | parted)", "(back | limp | idle)", ("duplicate", _PAIR)
    ),
    "no close": Mutant(ServoPort.close, "if self._closed:", "if True:"),
}


@contextmanager
def mutated(mutant: Mutant) -> Iterator[None]:
    """Breaks the function in place for the length of the block, wherever it has been imported, and its cure's.

    Raises:
        ValueError: if its source no longer has the text.
    """
    if mutant.cure:
        with mutated(MUTANTS[mutant.cure]), mutated(mutant._replace(cure="")):
            yield
        return
    function = cast(FunctionType, mutant.function)
    source = textwrap.dedent(inspect.getsource(function))
    if mutant.text not in source:
        raise ValueError(f"{function.__qualname__} no longer has '{mutant.text}'")
    source = source.replace(mutant.text, mutant.instead).removeprefix("@property\n")
    made: dict[str, FunctionType] = {}
    exec(compile(source, "mutant", "exec"), function.__globals__, made)
    whole = function.__code__
    function.__code__ = made[function.__name__].__code__
    try:
        yield
    finally:
        function.__code__ = whole
