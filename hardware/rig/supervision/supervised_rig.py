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

import time
from collections.abc import Callable, Sequence
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from hardware.bus.port import lasting_name
from hardware.bus.servo_bus import Bus
from hardware.errors import RigError, SerialPortError
from hardware.rig.driving.dynamixel_rig import DynamixelRig
from hardware.rig.driving.register_reading import RegisterReading
from hardware.rig.faults import RigFaults
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array
from hardware.rig.supervision.health import Health, Incident
from hardware.rig.supervision.joint_pace import JointPace
from hardware.rig.supervision.mending import Mending
from hardware.rig.supervision.servo_states import CONDITIONS, ServoStates
from hardware.rig.switching.port_scan import PortScan
from hardware.rig.timings import Timings

_MENDED_WITHIN = 2.0  # s, for all but a vanished port
_MOST_LOOKS = 8  # servos whose registers wait to be read


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
        self._rig = DynamixelRig(config, open_bus())
        began = self._rig.now()
        self._pace, self._health = JointPace(config, began), Health(config, began)
        self._mending = Mending(self._rig, self._health, open_bus, beside, sleep)
        self._stopped = False

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
    def yielding(self) -> NDArray[np.bool_]:
        """Which joints push against something and give way, shape (J,)."""
        return self._pace.strain.yielding

    def write(self, targets: Array) -> None:
        """Sends the targets (J,), rad, or as far towards them as the joints' speed limits allow by now.

        It asks for the state too: see `DynamixelRig.write`.
        """
        if not self._ready():
            self._rig.faults.unsent[:] += 1
            return
        rig, pace = self._rig, self._pace
        try:
            targets, ways = pace.bound(targets, rig.readings.positions, rig.now())
            rig.write(targets, ways)
            if np.logical_or.reduce(pace.catching_up.joints):
                pace.sent(targets, rig.goals, rig.positions)
                rig.keep_pace(pace.of_servos)
        except SerialPortError as error:
            self._mend_port(error)
        if not self._mending.under_way and rig.stopped:
            self._mending.start(_MENDED_WITHIN)

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
        if not self._mending.under_way:
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
            raise RigError(f"{one.name} ({one.model}) cannot be restarted. Switch its power off and on.")
        self._health.take_back(joint, self._rig.now())
        self._mending.to_do = lambda bus: bus.restart(one.id)

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
        if self._mending.under_way or self._stopped or self._mending.to_do is not None:
            raise RigError("the rig is busy with its servos. Try again.")
        silent = (self._rig.readings.missed_in_a_row > 0) & ~self._health.lost
        if np.logical_or.reduce(silent):
            raise RigError("a servo does not answer just now. Try again when the rig has mended or given up on it.")
        scan = PortScan(self.config)
        self._mending.to_do = scan.ask
        return scan

    def close(self) -> list[str]:
        """Ends it as the rig file asks; may be called twice.

        Returns:
            The joints that did not confirm it.
        """
        self._stopped = True
        self._mending.stop()
        if self._mending.mended is not None:
            self._rig.attach(*self._mending.mended)
        return self._rig.close()

    def _ready(self) -> bool:
        """Whether the rig takes and gives anything now; ends a mending that is over.

        Raises:
            RigError: if mending has failed.
        """
        if self._mending.under_way and self._mending.over:
            mended = self._mending.take()
            if mended is None:
                self._stopped = True
                raise RigError(f"the rig has stopped: {self._mending.failure}") from self._mending.failure
            if self._rig.gone:
                self._note_port("is back", fault=False)
            self._rig.attach(*mended)
            self.recoveries += 1
            now = self._rig.now()
            self._health.mended(self._health.mend, now)
            self._pace.start_again(now)
            self._rig.keep_pace(self._pace.of_servos)
        return not (self._mending.under_way or self._stopped)

    def _mend_port(self, error: SerialPortError) -> None:
        """Starts to look for a port that has vanished.

        Raises:
            RigError: if the rig file does not want that.
        """
        self._note_port("is gone")
        if self.config.reconnect_s == 0.0:
            self._stopped = True
            raise RigError(f"the rig has stopped: {error}") from error
        self._mending.start(self.config.reconnect_s)

    def _note_port(self, what: str, *, fault: bool = True) -> None:
        """Makes an incident of what has happened to the port."""
        self._health.incidents.append(Incident(self._rig.now(), f"the port {self.config.port}", what, fault))

    def _look_after(self) -> None:
        """Eases hot joints, has joints mended, and stops the rig for a lost one or goes on without it.

        Raises:
            RigError: if the rig must stop.
        """
        rig, health, now = self._rig, self._health, self._rig.now()
        self._pace.strain.note(rig.currents, now)
        self._pace.ease.note(rig.readings.temperatures, rig.readings.voltages)
        health.look(rig.readings, rig.goals, self._pace.strain.yielding, now)
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
        if np.logical_or.reduce(held_on) and not self._mending.under_way:
            try:
                rig.loosen(np.flatnonzero(held_on).tolist())
            except SerialPortError as error:
                self._mend_port(error)
        if (np.logical_or.reduce(health.mend) or self._mending.to_do is not None) and not self._mending.under_way:
            self._mending.start(_MENDED_WITHIN)
