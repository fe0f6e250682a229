"""The servos of one port as a real-time loop drives them: positions out, states in; nothing waits.

A tick is  collect_state, write(counts):  one read and one write. The goals leave with a request for the state, whose
reply travels while the loop does other things, and is collected a tick later.

Some servos have no watchdog: they go to their last goal, which is near, and hold. Each other servo's bus watchdog is
armed by the first write, since nothing moves before, and again once a second, with the speed that each keeps: a sync
write is not answered, so a lost one would go unnoticed. When the loop falls silent for longer, the servos stop and
hold, and get no more goals until `attach`: a rig never runs after targets that went on.

A servo that is silent under its own ID may listen to another's, and would take the speed of that joint for its own. So
speeds are sent only while every servo answers, and again as soon as all do after a silence. Where a servo turns out to
be silent right behind such a write, all get the slowest of the silent ones' speeds meanwhile.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.bus.servo_bus import Bus
from hardware.errors import MotiondeckError, RigError, with_torque
from hardware.families.family import Family
from hardware.rig.counters import RigFaults
from hardware.rig.driving.readings import Measurements, Readings
from hardware.rig.registers import read_each, same_place, sync_write_all
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array, RigScale
from hardware.rig.state_block import OwnSettings, StateBlock, arrange_state, read_own_settings
from hardware.rig.switching.identities import know_fast_reads
from hardware.rig.switching.torque import Held, hold_each, speed_counts, switch_off, switch_on
from hardware.rig.switching.turns import keep_zeros
from hardware.rig.turn_file import TurnFile

_ARM_AGAIN = 1.0  # s
_WRITTEN = ("goal_position", "profile_velocity", "bus_watchdog")
_BEHIND_HEADER = 4  # bytes of a frame: the header itself may have a pattern that is stuffed
_SHORT_DELAY = 20e-6  # s; a servo's answer that starts so soon costs nothing that could be saved


class Prepared(NamedTuple):
    """Servos of a port that hold where they stand, with what is read of them."""

    rows: list[int]  # their indices in the rig; see `RigConfig.servos`
    held: Held
    blocks: list[StateBlock]
    own: OwnSettings


class ServoPort:
    """Servos of a rig that are switched on; arrays have all J joints of the rig, in the order of its file.

    `write`, `request_state` and `collect_state` neither wait nor raise, whatever state the servos are in; only a port
    that has vanished raises SerialPortError.
    """

    def __init__(
        self,
        config: RigConfig,
        part: RigConfig,
        bus: Bus,
        scale: RigScale,
        measured: Measurements,
        faults: RigFaults,
        turns: TurnFile | None,
    ) -> None:
        """Switches the servos `part`, a rig of one port, of an open bus on, each where it stands.

        Readings are written into `measured`, faults counted in `faults`, and zeros kept in `scale`, of the whole rig.
        In `turns` it is kept in which turn joints stand; without, each counts from its zero in the rig file. RigError
        if servos are missing, of another model, or not fit to be switched on; it names them all. Or if the wire is too
        slow for the rate. Torque is taken off again, the bus closed, and joints that did not confirm it named.
        """
        self.part = part
        self.joints = np.array([config.names.index(name) for name in part.names])  # indices in the rig, shape (n,)
        self.servos, names = part.servos, config.servos.names  # more than joints, where two turn one
        self.rows = np.array([names.index(name) for name in self.servos.names])  # indices in the rig, shape (s,)
        self.joint_of = np.array(config.joint_of)  # of all servos of the rig, shape (S,)
        self.bus = bus
        bus.families = part.families
        self._goals = list(_writes(self.servos, "goal_position", self.rows, len(names)))
        self._speeds = list(_writes(self.servos, "profile_velocity", self.rows, len(names)))
        count = len(config.joints)
        # The part of its speed limit that each servo keeps on its own, shape (J,); see `keep_pace`.
        self.pace, self._paced = np.ones(count), True
        self._unproven = False  # whether not all have answered since speeds were sent
        self.left_out = np.zeros(count, dtype=np.bool_)  # the rig goes on without them: their silence is expected
        self._own = np.zeros(len(names), dtype=np.bool_)
        self._own[self.rows] = True
        self._last_sent, self._patience = 0.0, part.patience
        self.gone = False  # whether the rig has found the port gone, or it is closed
        self._armed = self._stopped = self._closed = False
        self._arm_next = self._reads_next = 0.0
        self._switched_on = False
        self.scale = scale
        self.turns = turns
        self.goals = np.zeros(count)  # where the rig wants the joints, shape (J,), rad
        self.ended: Callable[[Bus], None] = lambda bus: None  # called at the end, before the bus is closed
        try:
            servos = self.servos
            held = switch_on(servos, bus, turns)
            self._fast = know_fast_reads(servos, read_each(servos, bus, "firmware_version"))
            prepared = self.prepare(servos, self.rows.tolist(), held)
            delays = [2e-6 * count for count in read_each(servos, bus, "return_delay_time")]
            refuse_slow_wire(servos, prepared.blocks, self._fast, delays)
        except MotiondeckError as error:
            raise with_torque(error, self.close()) from error
        except BaseException:
            self.close()
            raise
        self._switched_on = True
        self.readings = Readings(config, self.rows.tolist(), scale, measured, faults)
        self.attach(prepared, bus.port.now())

    @property
    def believed(self) -> Array:
        """Where the servos of this port were last seen, and their goals, shape (2, s), rad: see `find_zeros`."""
        return np.array([self.readings.measured.seen[self.rows], self.goals[self.joint_of[self.rows]]])

    @property
    def stopped(self) -> bool:
        """Whether the bus was silent for so long that the servos' watchdogs have stopped them; see `attach`."""
        return self._stopped or (self._armed and self.bus.port.now() - self._last_sent > self._patience)

    def write(self, counts: Array) -> bool:
        """Sends goals of the rig's servos, shape (S,), pulses, and requests the state with them; False if not sent.

        Now and then watchdogs and speeds go before them. Nothing is requested while a reply is under way, or before it
        is due by the rig file's `read_hz`.
        """
        self._stopped = self.stopped
        if self._stopped:
            return False
        now = self.bus.port.now()
        if not self._armed or now >= self._arm_next:
            self._armed = sync_write_all(self.servos, self.bus, "bus_watchdog", self.part.watchdog_units) or self._armed
            self._arm_next = now + _ARM_AGAIN
            self._paced = False
        data = _frames(self._goals, counts)
        missed = self.readings.measured.missed_in_a_row
        if np.logical_or.reduce(missed) and np.logical_or.reduce(silent := self._silent(missed)):
            if self._unproven:
                data = self._speed_frames(silent) + data
            self._paced = self._unproven = False
        elif not self._paced and self._request(self._speed_frames() + data):
            self._paced = self._unproven = True
            return True
        if self._request(data):
            self._unproven = False
            return True
        self._last_sent = now
        return self.bus.send(data)

    def _silent(self, missed: NDArray[np.int64]) -> NDArray[np.bool_]:
        """The servos of this port that should answer and do not, shape (S,)."""
        return (missed > 0) & ~self.left_out[self.joint_of] & self._own

    def request_state(self) -> None:
        """Requests the state without sending goals; nothing happens while a reply is under way."""
        self._stopped = self.stopped
        self._request()

    def collect_state(self, now: float) -> bool:
        """Takes the reply if it has come in the meantime, as measured at `now`, s; whether anything new was."""
        reply = self.bus.collect() or self.bus.collect_early()
        return reply is not None and self.readings.take(reply, now)

    def prepare(self, servos: RigConfig, rows: list[int], held: Held) -> Prepared:
        """Keeps the zeros of servos that hold, arranges their states, and reads their own settings."""
        keep_zeros(servos, held.zeros, self.turns)
        return Prepared(rows, held, arrange_state(servos, self.bus), read_own_settings(servos, self.bus))

    def attach(self, prepared: Prepared, now: float) -> None:
        """Goes on with servos where they hold; see `Readings.start`."""
        rows, held, blocks, own = prepared
        self.scale.zero[rows] = held.zeros
        measured = self.readings.measured
        measured.hottest[rows], measured.slack[rows], measured.shutdown[rows] = own
        self.readings.start(rows, held.angles, blocks, now)
        self._stopped = self._armed = self.gone = False

    def keep_pace(self, pace: Array) -> None:
        """Has each servo keep to this part of its speed limit, shape (J,), once every servo answers."""
        if not np.array_equal(pace, self.pace):
            self.pace, self._paced = pace, False

    def loosen(self, joints: NDArray[np.bool_]) -> None:
        """Takes the torque off the servos of these joints, shape (J,), unanswered and without waiting."""
        own = np.flatnonzero(joints[self.joint_of[self.rows]]).tolist()
        if own:
            sync_write_all(self.servos.only(own), self.bus, "torque_enable", 0)

    def close(self, *, hold: bool = False) -> list[str]:
        """Switches off, or holds, as the rig file asks or as given; returns the joints that did not confirm it."""
        if self._closed:
            return []
        self.gone = True
        holds = self._switched_on and (hold or self.part.on_exit == "hold")
        end = partial(hold_each, believed=self.believed) if holds else switch_off
        try:
            unconfirmed = end(self.servos, self.bus)
            if self._switched_on:
                self.ended(self.bus)
        finally:
            self.bus.close()
        self._closed = True
        return unconfirmed

    def _speed_frames(self, silent: NDArray[np.bool_] | None = None) -> bytes:
        """The frames that give each servo its part of the speed limit, none more than a silent one keeps."""
        paces = zip(self.servos.joints, self.pace[self.joint_of[self.rows]].tolist(), strict=True)
        counts = np.zeros(len(self._own))
        counts[self.rows] = [speed_counts(joint, pace) for joint, pace in paces]
        if silent is not None:
            for write in self._speeds:
                own = counts[write.rows]
                counts[write.rows] = np.minimum(own, own[silent[write.rows]].min(initial=own.max()))
        return _frames(self._speeds, counts)

    def _request(self, before: bytes = b"") -> bool:
        """Sends the next request if it is due, behind these frames; False if nothing was sent."""
        now = self.bus.port.now()
        if now < self._reads_next:
            return False
        # No servo's reply is missed for registers while speeds have to be proven.
        reading = self.readings.next_register_reading() if self._paced and not self._unproven else None
        if reading is not None:
            request, blocks, before = reading, (reading.block,), before + reading.write
        else:
            request = self.readings.next_request()
            blocks = request.blocks
        if not self.bus.request(blocks, self._fast, before):
            return False
        self.readings.requested(request)
        self._last_sent = now
        if self.part.read_hz:
            # Half a tick of grace: a loop's ticks are never quite on time.
            self._reads_next = now + 1.0 / self.part.read_hz - 0.5 / self.part.rate_hz
        return True


def close_all(ports: Sequence[ServoPort], *, hold: bool = False) -> list[str]:
    """Closes every port, also after one has failed; returns the joints that did not confirm it."""
    unconfirmed: list[str] = []
    interrupted: BaseException | None = None
    for port in reversed(ports):
        try:
            unconfirmed += port.close(hold=hold)
        except Exception:  # the torque that is left on matters more than the error
            unconfirmed += port.part.names
        except BaseException as error:
            interrupted = error
    if interrupted is not None:
        raise interrupted
    return unconfirmed


class SyncWrite:
    """A register of servos of one family, given new values in each tick; what stays the same is made once."""

    def __init__(
        self, ids: Sequence[int], address: int, length: int, family: Family, rows: NDArray[np.int64] | slice
    ) -> None:
        """The register has 1, 2 or 4 bytes, signed; the servos are these `rows` of arrays of the rig."""
        self.rows, self._address, self._length, self._family = rows, address, length, family
        self._trailer, self._stuffed = family.trailer, family.stuffed
        empty = b"".join(bytes((id,)) + bytes(length) for id in ids)
        whole = family.instructions.sync_write(address, length, empty)
        self._body = bytearray(whole[: -len(family.trailer(whole))])
        self._head = len(self._body) - len(empty)
        entries = np.frombuffer(self._body, dtype=[("id", "u1"), ("value", f"<i{length}")], offset=self._head)
        self._values: NDArray[Any] = entries["value"]

    def frame(self, counts: Array) -> bytes:
        """The bytes of the frame with these values, counts of all servos of the rig."""
        self._values[:] = counts[self.rows]
        body = self._body
        if self._stuffed and body.find(self._stuffed, _BEHIND_HEADER) >= 0:
            return self._family.instructions.sync_write(self._address, self._length, bytes(body[self._head :]))
        return b"".join((body, self._trailer(body)))


def _writes(servos: RigConfig, name: str, rows: NDArray[np.int64], count: int) -> Iterator[SyncWrite]:
    for (family, address, length), members in same_place(servos, name).items():
        ids = [servos.joints[index].id for index in members]
        yield SyncWrite(ids, address, length, family, slice(None) if len(members) == count else rows[members])


def _frames(writes: list[SyncWrite], counts: Array) -> bytes:
    return b"".join([write.frame(counts) for write in writes])


def longest_tick(config: RigConfig, blocks: Sequence[StateBlock], fast: bool, own_delays: Sequence[float]) -> float:
    """The longest time of goals, a request and its replies while all servos of one port answer, s.

    They must fit into one tick, also into the one of each second that sends speeds and watchdogs again: bytes sent
    during a reply destroy both. For the block read of each joint and the return delay of its servo, s; `fast` if servos
    may answer in a joint reply.
    """
    servos = config.servos
    count = len(servos.joints)
    readings = Readings(servos, range(count), RigScale(servos), Measurements(count), RigFaults.none(count))
    readings.start(range(count), np.zeros(count), blocks, 0.0)
    writes = [write for name in _WRITTEN for write in _writes(servos, name, np.arange(count), count)]
    written = len(_frames(writes, np.zeros(count)))
    longest = 0.0
    for request in readings.every_request():
        read = servos.joints[request.joints[0]].table.family.group_read(request.blocks, fast)
        delays = [own_delays[index] for index in request.joints]
        answered_after = max(delays) if read.fast else sum(delays)
        longest = max(longest, 10.0 * (written + len(read.frame) + read.needed) / config.baud + answered_after)
    return longest


def refuse_slow_wire(config: RigConfig, blocks: Sequence[StateBlock], fast: bool, own_delays: Sequence[float]) -> None:
    """Raises a RigError with the remedy if a rig's ticks do not fit on its wire; arguments as of `longest_tick`."""
    longest = longest_tick(config, blocks, fast, own_delays)
    if longest * config.rate_hz <= 1.0:
        return
    slow = max(own_delays)
    quicker = "motiondeck rig doctor --fix shortens their return delay; or lower" if slow > _SHORT_DELAY else "Lower"
    raise RigError(
        f"the wire is too slow for rate_hz {config.rate_hz:g}: goals and answers of {len(blocks)} servos take "
        f"{longest * 1e3:.1f} ms at {config.baud} baud, a tick is {1e3 / config.rate_hz:.1f} ms. "
        f"{quicker} rate_hz to {int(1.0 / longest)}, or raise baud."
    )
