"""A rig of Dynamixel servos as a real-time loop drives it: angles in, angles out; nothing waits and nothing raises.

A tick is  collect_state, write(targets):  one read and one write. The goals leave with a question for the state, whose
answer travels while the loop does other things, and is collected a tick later.

The AX, RX, MX (Protocol 1.0) and XL-320 servos have no watchdog: they go to their last goal, which is near, and hold.
Each other servo's bus watchdog is armed by the first write, since nothing moves before, and again once a second, with
the speed that each keeps: a sync write is not answered, so one that got lost would go unnoticed. When the loop falls
silent for longer, the servos stop and hold, and get no more goals until `attach`: a rig never runs after targets that
went on without it.

A servo that is silent under its own ID may listen to another's, and would take the speed of that joint for its own. So
speeds are sent only while every servo answers, and again as soon as all do after a silence. Where a servo turns out to
be silent right behind such a write, all are told the slowest of the silent ones' speeds meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.bus.servo_bus import Bus
from hardware.bus.sync_write import SyncWrite
from hardware.errors import MotiondeckError, SerialPortError, with_torque
from hardware.rig.driving.indirect_cells import arrange_state
from hardware.rig.driving.readings import Readings
from hardware.rig.driving.state_block import StateBlock
from hardware.rig.driving.wire_load import refuse_slow_wire
from hardware.rig.faults import RigFaults
from hardware.rig.registers import return_delays, same_place, tell_all
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array, RigScale
from hardware.rig.switching.identities import knows_fast_reads
from hardware.rig.switching.torque import hold_each, speed_counts, switch_off, switch_on
from hardware.rig.timings import Timings

WATCHDOG_UNIT = 0.02
"""s, in which the servos count."""
_ARM_AGAIN = 1.0  # s


class DynamixelRig:
    """A rig that is switched on; arrays follow the order of the rig file's joints.

    `write`, `request_state` and `collect_state` neither wait nor raise, whatever state the servos are in; only a port
    that is gone raises SerialPortError, once, and from then on they do nothing.

    Attributes:
        config: the rig file.
        names: of the joints.
        readings: the latest measurements.
        goals: last sent, shape (J,), rad.
        bus: what the servos are on.
        gone: whether the port is gone, or the rig closed.
        pace: the part of its speed limit that each servo keeps on its own, shape (J,); see `keep_pace`.
        left_out: the joints that the rig goes on without, shape (J,): their silence is expected.
        faults: what went wrong so far.
        write_us: how long each `write` took.
        read_us: how long each `collect_state` took; never the time on the wire.
    """

    def __init__(self, config: RigConfig, bus: Bus) -> None:
        """Switches the servos of an open bus on, each where it stands.

        Raises:
            RigError: if servos are missing, of another model, or not fit to be switched on; it names them all. Or if
                the wire is too slow for the rate. Torque is taken off again, the bus closed, and joints that did not
                confirm that are named too.
            SerialPortError: if the port vanishes; the same.
        """
        self.config = config
        self.names = config.names
        self.faults = RigFaults.none(len(config.joints))
        self.write_us = Timings()
        self.read_us = Timings()
        self.bus = bus
        self._scale = RigScale(config)
        self._ids = [joint.id for joint in config.joints]
        bus.old = config.old_ids
        self._goals = list(_groups(config, "goal_position"))
        self._speeds = list(_groups(config, "profile_velocity"))
        self.pace, self._paced = np.ones(len(self._ids)), True
        self._unproven = False  # whether not all have answered since speeds were sent
        self.left_out = np.zeros(len(self._ids), dtype=np.bool_)
        self.readings = Readings(config, self._scale, self.faults)
        self._last_word = 0.0
        self._armed = self._stopped = self.gone = self._closed = False
        self._arm_next = self._reads_next = 0.0
        self._held = False
        try:
            self.goals = switch_on(config, bus)
            self._fast = knows_fast_reads(config, bus)
            blocks = arrange_state(config, bus)
            refuse_slow_wire(config, blocks, self._fast, return_delays(config, bus))
        except MotiondeckError as error:
            raise with_torque(error, self.close()) from error
        except BaseException:
            self.close()
            raise
        self._held = True
        self.readings.start(range(len(self._ids)), self.goals, blocks, self.now())

    @classmethod
    def connect(cls, config: RigConfig, port: str | None = None) -> DynamixelRig:
        """Opens the port (the rig file's own, unless another is named) and switches the rig on.

        Raises:
            RigError: as the constructor.
            SerialPortError: if the port cannot be opened, or vanishes.
        """
        return cls(config, Bus.open(port or config.port, config.baud))

    def __enter__(self) -> DynamixelRig:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def stopped(self) -> bool:
        """Whether the bus was silent for so long that the servos' watchdogs have stopped them; see `attach`."""
        # One unit earlier than the servos, which count in units: rather stopped here and not there than the reverse.
        patience = self.config.watchdog_ms * 1e-3 - WATCHDOG_UNIT
        return self._stopped or (self._armed and self.bus.port.now() - self._last_word > patience)

    def write(self, targets: Array, reach: Array | None = None) -> None:
        """Sends the targets (J,), rad, as a sync write of goal positions, and asks for the state in the same write.

        No goal is farther from the last than `reach`, rad. Nothing is asked while an answer is under way, or before it
        is due by the rig file's `read_hz`. Targets beyond a limit are clipped, those that are NaN or infinite leave the
        joint's goal as it was; both are counted.
        """
        if self.gone:
            return
        with self.write_us:
            finite = np.isfinite(targets)
            wanted = np.where(finite, targets, self.goals)
            goals = np.minimum(np.maximum(wanted, self._scale.lower), self._scale.upper)
            self.faults.clipped[:] += wanted != goals
            self.faults.refused[:] += ~finite
            if reach is not None:
                goals = np.minimum(np.maximum(goals, self.goals - reach), self.goals + reach)
            try:
                sent = self._send(goals)
            except SerialPortError:
                self.gone = True
                raise
            if sent:
                self.goals = goals
            else:
                self.faults.unsent[:] += 1

    def request_state(self) -> None:
        """Asks the servos for their state without giving them targets; nothing happens while an answer is under way."""
        if self.gone:
            return
        try:
            self._stopped = self.stopped
            self._ask()
        except SerialPortError:
            self.gone = True
            raise

    def collect_state(self) -> bool:
        """Takes the answer if it has come in the meantime; whether anything new was measured."""
        if self.gone:
            return False
        with self.read_us:
            try:
                reply = self.bus.collect() or self.bus.collect_early()
            except SerialPortError:
                self.gone = True
                raise
            return reply is not None and self.readings.take(reply, self.bus.port.now())

    def attach(self, bus: Bus, joints: Sequence[int], held: Array, blocks: Sequence[StateBlock]) -> None:
        """Goes on over this bus, where these joints hold at these angles, rad; see `Readings.start`."""
        if self._closed:
            return
        self.bus = bus
        self.goals = self.goals.copy()
        self.goals[list(joints)] = held
        self.readings.start(joints, held, blocks, self.now())
        self._stopped = self._armed = self.gone = False

    def keep_pace(self, pace: Array) -> None:
        """Has each servo keep to this part of its speed limit, shape (J,), once every servo answers."""
        if not np.array_equal(pace, self.pace):
            self.pace, self._paced = pace, False

    def loosen(self, joints: Sequence[int]) -> None:
        """Takes the torque off some joints, unanswered and without waiting."""
        if joints and not self.gone:
            tell_all(self.config.only(joints), self.bus, "torque_enable", 0)

    @property
    def positions(self) -> Array:
        """Last measured, shape (J,), rad."""
        return self.readings.positions

    @property
    def velocities(self) -> Array:
        """Last measured, shape (J,), rad/s."""
        return self.readings.velocities

    @property
    def currents(self) -> Array:
        """Last measured, shape (J,), A, positive in the joint's direction."""
        return self.readings.currents

    def now(self) -> float:
        """The time on the port's clock, s."""
        return self.bus.port.now()

    def close(self) -> list[str]:
        """Ends as the rig file asks: torque off, or each joint held where it is; may be called twice.

        Returns:
            The joints that did not confirm it.
        """
        if self._closed:
            return []
        self.gone = True
        end = hold_each if self._held and self.config.on_exit == "hold" else switch_off
        try:
            unconfirmed = end(self.config, self.bus)
        finally:
            self.bus.close()
        self._closed = True
        return unconfirmed

    def _send(self, goals: Array) -> bool:
        """One sync write of goals, now and then after others of watchdogs and speeds; False if nobody got them."""
        self._stopped = self.stopped
        if self._stopped:
            return False
        now = self.bus.port.now()
        if not self._armed or now >= self._arm_next:
            units = round(self.config.watchdog_ms * 1e-3 / WATCHDOG_UNIT)
            self._armed = tell_all(self.config, self.bus, "bus_watchdog", units) or self._armed
            self._arm_next = now + _ARM_AGAIN
            self._paced = False
        data = _frames(self._goals, self._scale.pulses(goals))
        missed = self.readings.missed_in_a_row
        if np.logical_or.reduce(missed) and np.logical_or.reduce(silent := (missed > 0) & ~self.left_out):
            if self._unproven:
                data = self._speed_frames(silent) + data
            self._paced = self._unproven = False
        elif not self._paced and self._ask(self._speed_frames() + data):
            self._paced = self._unproven = True
            return True
        if self._ask(data):
            self._unproven = False
            return True
        self._last_word = now
        return self.bus.port.send(data)

    def _speed_frames(self, silent: NDArray[np.bool_] | None = None) -> bytes:
        """What tells each servo the part of its speed limit that it keeps, or none more than a silent one keeps."""
        joints = zip(self.config.joints, self.pace.tolist(), strict=True)
        counts = np.array([speed_counts(joint, pace) for joint, pace in joints])
        if silent is not None:
            for group in self._speeds:
                own = counts[group.joints]
                counts[group.joints] = np.minimum(own, own[silent[group.joints]].min(initial=own.max()))
        return _frames(self._speeds, counts)

    def _ask(self, before: bytes = b"") -> bool:
        """Sends the next question if it is due, behind these frames; False if nothing was sent."""
        now = self.bus.port.now()
        if now < self._reads_next:
            return False
        # No servo's answer is missed for registers while speeds have to be proven.
        if self._paced and not self._unproven and (look := self.readings.next_look()) is not None:
            if not self.bus.request((look.block,), self._fast, before + look.write):
                return False
            look.write = b""
            self.readings.asked(look)
        else:
            question = self.readings.next_question()
            if not self.bus.request(question.asked, self._fast, before):
                return False
            self.readings.asked(question)
        self._last_word = now
        if self.config.read_hz:
            # Half a tick of grace: a loop's ticks are never quite on time.
            self._reads_next = now + 1.0 / self.config.read_hz - 0.5 / self.config.rate_hz
        return True


class _Group(NamedTuple):
    """Joints whose servos keep a register at the same place, and speak the same protocol.

    Attributes:
        joints: their indices, shape (n,), or all.
        write: of their registers, counts.
    """

    joints: NDArray[np.int64] | slice
    write: SyncWrite


def _groups(config: RigConfig, name: str) -> Iterator[_Group]:
    """The joints by where a register is written."""
    groups = same_place(config, name)
    for (protocol, address, length), members in groups.items():
        write = SyncWrite([config.joints[index].id for index in members], address, length, old=protocol == 1)
        yield _Group(slice(None) if len(groups) == 1 else np.array(members), write)


def _frames(groups: list[_Group], counts: Array) -> bytes:
    """The sync writes of counts (J,), one a group."""
    frames = []
    for group in groups:
        group.write.values[:] = counts[group.joints]
        frames.append(group.write.frame())
    return b"".join(frames)
