"""A rig supervised while a loop drives it: nothing goes faster than its limit, and what can be mended is.

Goals follow the targets at each joint's speed limit in real time, however many targets a late loop sends at once; hot,
strained and weakly supplied joints are eased.

    the bus was silent too long      the watchdogs are cleared; the joints start again from where they stand
    a servo needs setting up again   it is checked, set up and switched on where it stands (see `health`)
    the port vanished                it is looked for, and every servo's identity and settings are verified first
    a servo is lost                  the rig stops and names it, or goes on without it, as the rig file asks

After each of these the joints catch up with their targets at a quarter of their speed limits. What waits for answers
runs beside the loop, never in it; meanwhile nothing is sent, so the servos' own watchdogs hold them still.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.bus.port import lasting_name
from hardware.bus.servo_bus import Bus
from hardware.errors import MotiondeckError, RigError, SerialPortError
from hardware.rig.driving.dynamixel_rig import DynamixelRig
from hardware.rig.driving.indirect_cells import arrange_state
from hardware.rig.driving.register_reading import RegisterReading
from hardware.rig.driving.state_block import StateBlock
from hardware.rig.faults import RigFaults
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array
from hardware.rig.supervision.catching_up import SLOWER, CatchingUp
from hardware.rig.supervision.easing import Easing
from hardware.rig.supervision.health import Health, Incident
from hardware.rig.supervision.servo_states import CONDITIONS, ServoStates
from hardware.rig.supervision.strain import Strain
from hardware.rig.switching.port_scan import PortScan
from hardware.rig.switching.torque import resume
from hardware.rig.timings import Timings

_MENDED_WITHIN = 2.0  # s, for all but a vanished port
_PAUSE = 0.05  # s between two tries
_MOST_LOOKS = 8  # servos whose registers wait to be read
_LONGEST_STEP = 2.0  # ticks' worth of way for an eased joint after a stall: the servo would take it at full speed


class _Mended(NamedTuple):
    """What mending has brought back; the arguments of `DynamixelRig.attach`."""

    bus: Bus
    joints: list[int]
    held: Array
    blocks: list[StateBlock]


class SupervisedRig:
    """A rig that is switched on; arrays follow the order of the rig file's joints.

    `write`, `request_state` and `collect_state` neither wait nor raise, but for one RigError when the rig has stopped
    for good; it names the servo, and from then on they do nothing.

    Attributes:
        config: the rig file.
        names: of the joints.
        recoveries: how often something was mended.
    """

    def __init__(
        self,
        config: RigConfig,
        open_bus: Callable[[], Bus],
        beside: bool = True,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Opens the bus and switches the servos on, each where it stands.

        Args:
            config: the rig file.
            open_bus: opens the bus, now and again after the port has vanished.
            beside: whether mending runs in a thread beside the loop; otherwise the loop waits for it.
            sleep: how to wait where there is no port to wait on.

        Raises:
            RigError: as `DynamixelRig`.
            SerialPortError: if the port cannot be opened, or vanishes.
        """
        self.config = config
        self.names = config.names
        self.recoveries = 0
        self._open_bus = open_bus
        self._beside = beside
        self._sleep = sleep
        self._rig = DynamixelRig(config, open_bus())
        self._speed = np.array([joint.velocity for joint in config.joints])
        self._ease = Easing(config)
        self._strain = Strain(config)
        self._catching_up = CatchingUp(config)
        self._last_write = self._rig.now()
        self._health = Health(config, self._last_write)
        self._job: threading.Thread | None = None
        self._mending = self._stopped = False
        self._failure: MotiondeckError | None = None
        self._mended: _Mended | None = None
        self._to_do: Callable[[Bus], object] | None = None  # what waits for answers, and so has to be done beside

    @classmethod
    def connect(cls, config: RigConfig) -> SupervisedRig:
        """Opens the port of a rig that has only one (see `joined_rig.connect_rig`) and switches the rig on.

        Raises:
            RigError: as `DynamixelRig`.
            SerialPortError: if the port cannot be opened, or vanishes.
        """
        # The adapter may come back as another tty; by this name it is found again.
        port = lasting_name(config.port)
        return cls(config, lambda: Bus.open(port, config.baud))

    def __enter__(self) -> SupervisedRig:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def positions(self) -> Array:
        """Last measured, shape (J,), rad."""
        return self._rig.positions

    @property
    def velocities(self) -> Array:
        """Last measured, shape (J,), rad/s."""
        return self._rig.velocities

    @property
    def currents(self) -> Array:
        """Last measured, shape (J,), A."""
        return self._rig.currents

    @property
    def temperatures(self) -> Array:
        """Last measured, shape (J,), degC; NaN until first read."""
        return self._rig.readings.temperatures

    @property
    def voltages(self) -> Array:
        """Last measured supply voltages, shape (J,), V; NaN until first read."""
        return self._rig.readings.voltages

    @property
    def states(self) -> ServoStates:
        """What each servo does now."""
        readings, silent = self._rig.readings, CONDITIONS.index("does not answer")
        conditions = self._health.conditions
        return ServoStates(
            self._rig.goals,
            readings.positions,
            readings.currents,
            readings.temperatures,
            readings.voltages,
            readings.errors,
            readings.torque,
            np.maximum(conditions, silent) if self._rig.gone else conditions,
        )

    @property
    def incidents(self) -> Sequence[Incident]:
        """The latest incidents, each naming its joint or the port, in order of time."""
        return self._health.incidents

    @property
    def lost(self) -> NDArray[np.bool_]:
        """The joints that the rig goes on without, shape (J,)."""
        return self._health.lost

    @property
    def faults(self) -> RigFaults:
        """What went wrong so far."""
        return self._rig.faults

    @property
    def write_us(self) -> Timings:
        """How long each `write` took."""
        return self._rig.write_us

    @property
    def read_us(self) -> Timings:
        """How long each `collect_state` took."""
        return self._rig.read_us

    @property
    def easing(self) -> Array:
        """The part of its speed limit that each joint may use now, shape (J,)."""
        return np.minimum(self._ease.part, self._catching_up.pace)

    @property
    def yielding(self) -> NDArray[np.bool_]:
        """Which joints push against something and give way, shape (J,)."""
        return self._strain.yielding

    def write(self, targets: Array) -> None:
        """Sends the targets (J,), rad, or as far towards them as the joints' speed limits allow by now.

        It asks for the state too: see `DynamixelRig.write`.
        """
        if not self._ready():
            self._rig.faults.unsent[:] += 1
            return
        try:
            self._send(targets)
        except SerialPortError as error:
            self._mend_port(error)
        if not self._mending and self._rig.stopped:
            self._mend(_MENDED_WITHIN)

    def request_state(self) -> None:
        """Asks the servos for their state without giving them targets; see `DynamixelRig.request_state`."""
        if self._ready():
            try:
                self._rig.request_state()
            except SerialPortError as error:
                self._mend_port(error)

    def collect_state(self) -> bool:
        """Takes the answer if it has come in the meantime; whether anything new was measured."""
        if not self._ready():
            return False
        fresh = False
        try:
            fresh = self._rig.collect_state()
        except SerialPortError as error:
            self._mend_port(error)
        if not self._mending:
            self._look_after()
        return fresh

    def switch_off(self, joint: int) -> None:
        """Has the torque taken off a joint; the rig goes on without it until `set_up_again`."""
        self._health.take_out(joint, self._rig.now())

    def set_up_again(self, joint: int) -> None:
        """Counts on a joint again: one without torque is set up and switched on where it stands, beside the loop."""
        self._health.take_back(joint, self._rig.now())

    def restart(self, joint: int) -> None:
        """Has a joint's servo restarted, beside the loop; it is then set up again, and the others hold meanwhile.

        Raises:
            RigError: if its model cannot be restarted.
        """
        one = self.config.joints[joint]
        if one.table.protocol == 1:
            raise RigError(f"{one.name} is a {one.model}, which cannot be restarted. Switch its power off and on.")
        self._health.take_back(joint, self._rig.now())
        self._to_do = lambda bus: bus.restart(one.id)

    def registers(self, joint: int, write: tuple[str, int] | None = None) -> RegisterReading:
        """Reads all registers of a servo in the loop's next ticks; before that, writes a count into one of them.

        Raises:
            RigError: if that is not allowed: see `register_reading`, and the joint must have been switched off.
        """
        servo, readings = self.config.joints[joint], self._rig.readings
        look = RegisterReading(joint, servo, write)
        if write is not None and (readings.torque[joint] or not self._health.off[joint]):
            raise RigError(f"registers of {servo.name} are written only while its torque is off: switch it off first.")
        if readings.missed_in_a_row[joint] > 2:
            raise RigError(f"{servo.name} (id {servo.id}) does not answer.")
        if len(readings.looks) >= _MOST_LOOKS:
            raise RigError("the registers of several servos are being read already. Try again.")
        readings.looks.append(look)
        return look

    def scan(self) -> PortScan:
        """Asks who is on the port, beside the loop; all servos hold meanwhile, as when one is restarted.

        Raises:
            RigError: if a servo is silent just now, or something else is being done: holding could then end the run.
        """
        if self._mending or self._stopped or self._to_do is not None:
            raise RigError("the rig is busy with its servos. Try again.")
        silent = (self._rig.readings.missed_in_a_row > 0) & ~self._health.lost
        if np.logical_or.reduce(silent):
            raise RigError("a servo does not answer just now. Try again when the rig has mended or given up on it.")
        scan = PortScan(self.config)
        self._to_do = scan.ask
        return scan

    def close(self) -> list[str]:
        """Ends it as the rig file asks; may be called twice.

        Returns:
            The joints that did not confirm it.
        """
        self._stopped = True
        if self._job is not None:
            # Each of its waits for an answer has an end; before that it could still switch something on.
            self._job.join()
            if self._mended is not None:
                self._rig.attach(*self._mended)
        return self._rig.close()

    def _ready(self) -> bool:
        """Whether the rig takes and gives anything now; ends a mending that is over.

        Raises:
            RigError: if mending has failed.
        """
        if self._mending and (self._job is None or not self._job.is_alive()):
            self._mending, self._job = False, None
            if self._mended is None:
                self._stopped = True
                raise RigError(f"the rig has stopped: {self._failure}") from self._failure
            if self._rig.gone:
                self._note_port("is back", fault=False)
            self._rig.attach(*self._mended)
            self._mended = None
            self.recoveries += 1
            self._last_write = self._rig.now()
            self._health.mended(self._health.mend, self._last_write)
            self._catching_up.joints[:] = True
            self._keep_pace()
        return not (self._mending or self._stopped)

    def _mend_port(self, error: SerialPortError) -> None:
        """Starts to look for a port that has vanished.

        Raises:
            RigError: if the rig file does not want that.
        """
        self._note_port("is gone")
        if self.config.reconnect_s == 0.0:
            self._stopped = True
            raise RigError(f"the rig has stopped: {error}") from error
        self._mend(self.config.reconnect_s)

    def _note_port(self, what: str, *, fault: bool = True) -> None:
        """Makes an incident of what has happened to the port."""
        self._health.incidents.append(Incident(self._rig.now(), f"the port {self.config.port}", what, fault))

    def _mend(self, patience: float) -> None:
        """Starts to bring the rig back, for at most so long, s."""
        self._mending = True
        self._failure = self._mended = None
        if not self._beside:
            self._bring_back(patience)
        else:
            self._job = threading.Thread(target=self._bring_back, args=(patience,), name="rig-mending", daemon=True)
            self._job.start()

    def _bring_back(self, patience: float) -> None:
        """Opens the port if it is gone, verifies the servos and has them hold; again and again until it works."""
        bus = None if self._rig.gone else self._rig.bus
        waited, began = 0.0, self._rig.now()
        to_do, self._to_do = self._to_do, None
        while not self._stopped:
            try:
                if bus is None:
                    self._rig.bus.close()
                    # The rig's own at once, so that `close` always switches off over the port that is open.
                    self._rig.bus = bus = self._open_bus()
                    bus.old = self.config.old_ids
                if to_do is not None:
                    do, to_do = to_do, None
                    do(bus)
                joints = np.flatnonzero(~self._health.lost).tolist()
                alive = self.config.only(joints)
                held = resume(alive, bus, SLOWER, lambda: self._stopped)
                self._mended = _Mended(bus, joints, held, arrange_state(alive, bus))
                return
            except MotiondeckError as error:
                self._failure = error
                if isinstance(error, SerialPortError):
                    bus = None
            except Exception as error:  # whatever ends the thread must reach the loop
                self._failure = RigError(f"{type(error).__name__}: {error}")
                return
            self._sleep(_PAUSE)
            waited += _PAUSE
            if max(waited, self._rig.now() - began) >= patience:
                return

    def _send(self, targets: Array) -> None:
        """Sends the targets as far as each joint may go since the last ones; less far while it is eased."""
        now = self._rig.now()
        passed = max(0.0, now - self._last_write)
        self._last_write = now
        strain, part = self._strain, self._ease.part
        if np.logical_or.reduce(self._catching_up.joints):
            part = self.easing
        if np.logical_or.reduce(strain.yielding):
            here = self._rig.positions
            near = np.clip(targets, here - strain.reach, here + strain.reach)
            targets = np.where(strain.yielding, near, targets)
            self._catching_up.joints |= strain.yielding
            part = np.where(strain.yielding, 1.0, self.easing)
        eased_for = min(_LONGEST_STEP / self.config.rate_hz, passed)
        self._rig.write(targets, self._speed * part * np.where(part < 1.0, eased_for, passed))
        if np.logical_or.reduce(self._catching_up.joints):
            rig = self._rig
            self._catching_up.note(targets, rig.goals, rig.positions, strain.yielding, passed, now)
            self._keep_pace()

    def _keep_pace(self) -> None:
        """Has the servos themselves keep to the slower speed: one whose goal turns back would hurry after it.

        One that yields must let go at once.
        """
        self._rig.keep_pace(np.where(self._strain.yielding, 1.0, self._catching_up.pace))

    def _look_after(self) -> None:
        """Eases hot joints, has joints mended, and stops the rig for a lost one or goes on without it.

        Raises:
            RigError: if the rig must stop.
        """
        rig, health, now = self._rig, self._health, self._rig.now()
        self._strain.note(rig.currents, now)
        self._ease.note(rig.readings.temperatures, rig.readings.voltages)
        health.look(rig.readings, rig.goals, self._strain.yielding, now)
        rig.left_out = health.lost
        if np.logical_or.reduce(health.fatal):
            if self.config.on_loss == "stop" or (health.fatal | health.lost).all():
                self._stopped = True
                raise RigError(f"the rig has stopped: {health.reasons}. Mend the cause and start anew.")
            health.give_up(now)
            try:
                rig.loosen(np.flatnonzero(health.lost).tolist())
            except SerialPortError as error:
                self._mend_port(error)
        held_on = health.off & rig.readings.torque
        if np.logical_or.reduce(held_on) and not self._mending:
            try:
                rig.loosen(np.flatnonzero(held_on).tolist())
            except SerialPortError as error:
                self._mend_port(error)
        if (np.logical_or.reduce(health.mend) or self._to_do is not None) and not self._mending:
            self._mend(_MENDED_WITHIN)
