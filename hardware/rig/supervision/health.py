"""The health of a rig's joints: which need setting up again, and which are lost.

    limp       torque is off without a reason: the servo has restarted, or something switched it off      set up again
    back       it was cut off for longer than its own watchdog waits, which has stopped it                set up again
    apart      its two servos disagree about its angle                                                     lost
    idle       far from its goal, still, and drawing no current to get there                  set up again, then lost
    parted     its two servos work against each other; not where that did not end it          set up again
    down       it reports heat, encoder, shock or overload, or what else it shuts down for                 lost
    hot        at its temperature limit, though it has not shut down                                       lost
    silent     no answer for 1.6 s                                                                         lost
    restless   set up again five times in ten seconds                                                      lost

Each of these, and each warning (pushing against something, getting hot, low voltage), is an incident of a joint.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.families.models import TRAITS
from hardware.families.table import describe_errors
from hardware.rig.driving.readings import Measurements
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array
from hardware.rig.supervision.servo_states import CONDITIONS
from hardware.rig.switching.torque import APART

Mask = NDArray[np.bool_]

LOST_AFTER = 1.6  # s of silence of one servo
EASED_FROM = 12.0  # degC below the servo's limit from which it is hot
_MISSED_AFTER = 0.5  # s of silence until it is an incident
_IDLE_AFTER = 0.5  # s
_MOVED = 0.02  # rad
_FAR = 0.5  # of the slack: a servo so far from its goal drives with half of its voltage
_NEAREST_FAR, _FARTHEST_FAR = 0.05, 0.5  # rad
_IDLE_CURRENT = 0.2  # of what it may draw: a motor that drives towards a goal so far off draws more
# Of the stall current of both servos of a joint, s: where it is said, and where their paths have parted.
_OPPOSED, _OPPOSED_FOR = np.array([[0.08], [0.12]]), np.array([[0.5], [0.2]])
_TOGETHER_FOR = 3.0  # s that they stay together when they have been set up again; if not, their zeros are off
_SERIOUS = 4 | 8 | 16 | 32  # heat, encoder, shock, overload
_LOW_VOLTAGE = 0.8  # of the highest seen; each servo reports a voltage beyond its own limits
_RESTLESS, _RESTLESS_WITHIN = 5, 10.0  # times, s
INCIDENTS_KEPT = 200

# By incident the condition that it makes.
_KINDS = {
    "does not answer": "does not answer",
    "has lost its torque or restarted": "is limp",
    "was cut off for longer than watchdog_ms": "was cut off",
    "does not follow its target": "does not follow",
    "pushes against something and gives way": "gives way",
    "has servos that pull against each other": "pulls against itself",
    "is getting hot": "is getting hot",
    "has a low supply voltage": "has a low supply voltage",
    "has shut down": "has shut down",
}
_INCIDENTS = tuple(_KINDS)
_SILENT, _LIMP, _BACK, _STILL, _YIELDS, _AGAINST, _WARM, _STARVED, _DOWN = range(len(_KINDS))
_SEVERITY = np.array([CONDITIONS.index(condition) for condition in _KINDS.values()])
_OFF, _LOST = CONDITIONS.index("is off on command"), CONDITIONS.index("is lost")


class Incident(NamedTuple):
    """Something that happened to a joint or a port."""

    time: float  # on the port's clock, s
    source: str  # the joint with its id, or its second servo that fell silent, or the port
    what: str
    fault: bool = True  # whether something is wrong; not where it was commanded, or is well again
    silent: tuple[str, ...] = ()  # with one that fell silent: all of its port that did, those lost before if all did


class Health:
    """The health of a rig's J joints, whose `servos` are measured one by one."""

    def __init__(self, config: RigConfig, servos: Measurements, now: float) -> None:
        count, self._servos, self._joint_of = len(config.joints), servos, np.array(config.joint_of)
        self.incidents: deque[Incident] = deque(maxlen=INCIDENTS_KEPT)  # the latest, in order of time
        # Joints that need setting up again, that cannot be mended, that the rig goes on without, and those of them that
        # were switched off on command, shape (J,).
        self.mend, self.fatal, self.lost, self.off = (np.zeros(count, dtype=np.bool_) for _ in range(4))
        self._names = [servo.label for servo in config.servos.joints]
        self._patience = config.patience
        self._strongest = np.full(count, np.nan)
        stall = np.array([TRAITS[joint.model].stall_current for joint in config.joints])
        self._idle_below = _IDLE_CURRENT * np.fmin([joint.current or np.inf for joint in config.joints], stall)
        self._opposed = _OPPOSED * stall
        self._agreed, self._heard = np.full((2, count), now), np.full(count, now)
        self._parted, self._at_odds, self._missing, self._given_up = np.zeros((4, count), dtype=np.bool_)
        self._joined_at = np.full(count, -np.inf)
        self._grips = np.array([joint.grip for joint in config.joints])
        self._moved = np.array([min(_MOVED, 0.1 * joint.velocity) for joint in config.joints])
        self._read_at, self._missed = servos.read_at.copy(), servos.missed_in_a_row > 0
        self._port_of = np.array([config.ports.index(joint.port or config.port) for joint in config.joints])
        self._anchor, self._anchored = np.full(count, np.inf), np.full(count, now)
        self._idle, self._was_idle = (np.zeros(count, dtype=np.bool_) for _ in range(2))
        self._known = np.zeros((len(_KINDS), count), dtype=np.bool_)  # the incidents that last, as reported
        self._mended: list[deque[float]] = [deque(maxlen=_RESTLESS) for _ in range(count)]
        self._reason = [""] * count

    def look(
        self, measured: Measurements, goals: Array, yielding: Mask, recovering: Sequence[NDArray[np.int64]], now: float
    ) -> None:
        """Judges the joints by their latest measurements at the time `now`, s; sets `mend` and `fatal`.

        Goals are the last sent, shape (J,), rad; `yielding` joints give way to what they push against. Those that are
        `recovering`, as indices, port by port, stay as they were judged.
        """
        missing = measured.missed_in_a_row > 0
        silence = now - self._heard
        # A servo cut off for longer than its watchdog waits may have been stopped by it without a sign.
        back = self._missing & ~missing & (silence > self._patience)
        self._missing = missing
        self._heard[~missing] = now
        down = measured.errors & (measured.shutdown | _SERIOUS) != 0
        hot = measured.temperatures >= measured.hottest + 1.0
        silent = missing & (silence > LOST_AFTER)
        limp = ~measured.torque & ~down & ~missing
        still = self._still(measured, goals, now) & measured.torque & ~missing & ~yielding
        self._idle = idle = still & (np.abs(measured.currents) < self._idle_below)
        restless = limp & self._often_mended(now) if np.logical_or.reduce(limp) else limp
        free = np.ones(len(missing), dtype=np.bool_)
        for joints in recovering:
            free[joints] = False
        if np.logical_or.reduce(self.lost):
            self._return(~missing & ~down & free, now)
        alive = ~self.lost & free
        self._agreed[~(measured.against > self._opposed)] = now
        opposed, parted = now - self._agreed > _OPPOSED_FOR
        self._at_odds |= parted & (now - self._joined_at < _TOGETHER_FOR)
        self._parted = parted = parted & ~self._at_odds
        self.mend = np.where(free, alive & (back | limp | idle | parted), self.mend)
        apart = measured.apart > APART
        self.fatal = alive & (down | hot | silent | restless | apart | (idle & self._was_idle))
        margin = measured.hottest - measured.temperatures
        known, seen = self._known, np.empty_like(self._known)
        seen[_SILENT] = missing & (silence > _MISSED_AFTER)
        seen[_LIMP] = limp
        seen[_BACK] = back
        seen[_STILL] = still & ~(self._grips & ~idle)
        seen[_YIELDS] = yielding
        seen[_AGAINST] = opposed | parted
        seen[_WARM] = margin < EASED_FROM
        self._strongest = np.fmax(self._strongest, measured.voltages)
        seen[_STARVED] = (measured.voltages < _LOW_VOLTAGE * self._strongest) | (measured.errors & 1 != 0)
        seen[_DOWN] = down
        self._known = np.where(free, seen & alive, known)
        new = self._known & ~known
        if np.logical_or.reduce(new, axis=None):
            self._report(new, measured, silence, now)
        self._read_at[:], self._missed = self._servos.read_at, self._servos.missed_in_a_row > 0
        if np.logical_or.reduce(self.fatal):
            self._explain(measured, down, hot, silent, restless, apart)

    def recovered(self, joints: NDArray[np.int64], now: float) -> None:
        """Notes that the joints in `mend` among these indices were set up again."""
        for index in joints[self.mend[joints]].tolist():
            self._mended[index].append(now)
            self._was_idle[index] |= self._idle[index]
            self._joined_at[index] = now if self._parted[index] else self._joined_at[index]
        self._heard[joints] = self._anchored[joints] = self._agreed[:, joints] = now
        self._anchor[joints] = np.inf
        self._missing[joints] = False

    def give_up(self, now: float) -> None:
        """Goes on without the joints in `fatal`."""
        for index in np.flatnonzero(self.fatal).tolist():
            what = f"{self._reason[index]}; the rig goes on without it"
            self.incidents.append(Incident(now, self._name(index), what))
        self._given_up |= self.fatal & (self._was_idle | self._often_mended(now))
        self.lost |= self.fatal
        self.mend &= ~self.lost

    def miss(self, joints: Sequence[int], what: str, now: float) -> None:
        """Goes on without joints that could not be set up again with their port, for a reason in a word."""
        self.fatal[:] = False
        for index in joints:
            self.fatal[index], self._reason[index] = True, what
        self.give_up(now)

    def take_out(self, joint: int, now: float) -> None:
        """Goes on without a joint on command."""
        name = self._names[np.argmax(self._joint_of == joint)]  # where two servos turn it, both are
        self.incidents.append(Incident(now, name, "was switched off on command", fault=False))
        self.off[joint], self.lost[joint], self.mend[joint] = True, True, False

    def take_back(self, joint: int, now: float) -> None:
        """Counts on a joint again; without torque it is then set up anew."""
        for flags in (self.off, self.lost, self._given_up, self._was_idle, self._at_odds):
            flags[joint] = False
        self._mended[joint].clear()
        self._heard[joint] = self._anchored[joint] = now
        self._anchor[joint] = np.inf

    @property
    def conditions(self) -> NDArray[np.int64]:
        """The condition of each joint, places in `CONDITIONS`, shape (J,)."""
        worst = np.max(np.where(self._known, _SEVERITY[:, None], 0), axis=0)
        return np.where(self.off, _OFF, np.where(self.lost, _LOST, worst))

    @property
    def reasons(self) -> str:
        """Why the joints in `fatal` are lost, each named."""
        return "; ".join(f"{self._name(index)} {self._reason[index]}" for index in np.flatnonzero(self.fatal).tolist())

    def _name(self, joint: int) -> str:
        """The label of the first servo of a joint, or of its second if that alone was silent when last looked at."""
        own = np.flatnonzero(self._joint_of == joint)
        return self._names[own[np.argmax(self._missed[own])]]

    def _often_mended(self, now: float) -> Mask:
        return np.array([len(times) == _RESTLESS and now - times[0] < _RESTLESS_WITHIN for times in self._mended])

    def _still(self, measured: Measurements, goals: Array, now: float) -> Mask:
        """Which joints are far from their goals and have not moved for a while, by readings that are new."""
        positions = measured.positions
        far = np.minimum(np.maximum(_FAR * measured.slack, _NEAREST_FAR), _FARTHEST_FAR)
        moves = ~(np.abs(positions - self._anchor) < self._moved) | (np.abs(goals - positions) < far)
        self._anchor[moves], self._anchored[moves] = positions[moves], now
        return measured.read_at - self._anchored > _IDLE_AFTER

    def _return(self, well: Mask, now: float) -> None:
        """Takes joints back that were lost and answer without an error again."""
        returned = self.lost & well & ~self._given_up & ~self.off
        self.lost &= ~returned
        for index in np.flatnonzero(returned).tolist():
            self.incidents.append(Incident(now, self._name(index), "answers again", fault=False))

    def _report(self, new: Mask, measured: Measurements, silence: Array, now: float) -> None:
        for kind, index in zip(*(axis.tolist() for axis in np.nonzero(new)), strict=True):
            of_port = (self._port_of == self._port_of[index])[self._joint_of]
            quiet = (now - self._read_at > 0.5 * silence[index]) & of_port & (kind in (_SILENT, _BACK))
            others = quiet & ~self.lost[self._joint_of]
            quiet = quiet if np.array_equal(others, of_port & ~self.lost[self._joint_of]) else others
            with_it = tuple(self._names[one] for one in np.flatnonzero(quiet).tolist())
            self.incidents.append(Incident(now, self._name(index), _in_words(kind, measured, index), silent=with_it))

    def _explain(
        self, measured: Measurements, down: Mask, hot: Mask, silent: Mask, restless: Mask, apart: Mask
    ) -> None:
        for index in np.flatnonzero(self.fatal).tolist():
            reasons = (
                (down, _in_words(_DOWN, measured, index)),
                (hot, f"is too hot: {_heat(measured, index)}"),
                (silent, _in_words(_SILENT, measured, index)),
                (restless, "keeps restarting"),
                (apart, f"has two servos that are {measured.apart[index]:.2f} rad apart"),
            )
            else_ = "does not follow its target, although it was set up anew"
            self._reason[index] = next((reason for found, reason in reasons if found[index]), else_)


def _in_words(kind: int, measured: Measurements, index: int) -> str:
    """An incident of a joint, with what was measured of it."""
    details = {
        _DOWN: f": {describe_errors(int(measured.errors[index]))}",
        _WARM: f": {_heat(measured, index)}",
        _STARVED: f": {measured.voltages[index]:.1f} V",
    }
    return _INCIDENTS[kind] + details.get(kind, "")


def _heat(measured: Measurements, index: int) -> str:
    return f"{measured.temperatures[index]:.0f} degC, its limit is {measured.hottest[index]:.0f}"
