"""The rig: servos on one port or several, driven by a loop and kept alive beside it.

Goals follow the targets at each joint's speed limit in real time, however many targets a late loop sends at once; hot,
strained and weakly supplied joints are eased (see `pace`).

    the bus was silent too long      the watchdogs are cleared; the joints start again from where they stand
    a servo needs setting up again   it is checked, set up and switched on where it stands (see `health`)
    the port vanished                it is reopened, after every servo's identity and settings are verified
    a servo is lost                  the rig stops and names it, or goes on without it, as the rig file asks

After each of these the joints catch up with their targets at a quarter of their speed limits. What waits for replies
runs beside the loop, never in it; meanwhile nothing is sent there, so the servos' own watchdogs hold them still. The
ports carry their bytes at the same time; where one stops for good, the whole rig does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hardware.bus.port import lasting_name
from hardware.bus.servo_bus import Bus
from hardware.errors import LostServosError, MotiondeckError, RigError, SerialPortError, with_torque
from hardware.rig.counters import RigFaults, RigReport, Timings
from hardware.rig.driving.joined import JoinedMeasurements
from hardware.rig.driving.readings import Measurements
from hardware.rig.driving.register_reading import RegisterReading
from hardware.rig.driving.servo_port import ServoPort, close_all
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array, RigScale
from hardware.rig.supervision.health import Health, Incident
from hardware.rig.supervision.pace import JointPace
from hardware.rig.supervision.recovery import PortRecovery
from hardware.rig.supervision.servo_states import CONDITIONS, ServoStates
from hardware.rig.supervision.turn_keeper import KeeperThread, TurnKeeper
from hardware.rig.switching.identities import PortScan
from hardware.rig.turn_file import TurnFile

_RECOVERED_WITHIN = 2.0  # s, for all but a vanished port
_UNSEEN = 3  # replies in a row missed by a joint of several turns, which after a restart is looked for near its goal
_UNSEEN_S = 0.1  # s in which such a joint was not read, beside as many of its readings
_MOST_READINGS = 8  # servos whose registers wait to be read
_NO_ANSWER = CONDITIONS.index("does not answer")


class Rig:
    """A rig that is switched on; arrays follow the order of the rig file's joints.

    `write`, `request_state` and `collect_state` neither wait nor raise, but for one RigError when the rig has stopped
    for good; it names the servo, and from then on they do nothing.

    Attributes:
        goals: last sent, shape (J,), rad.
        positions, velocities, currents: last measured, shape (J,), rad, rad/s, A, in the joint's direction.
        temperatures, voltages: last measured, shape (J,), degC, V; NaN until first read.
        recoveries: how often something was recovered.
        turn_keepers: keep in which turn joints stand.
        write_us, read_us: durations of `write`, and of collecting a state; never the time on the wire.
    """

    def __init__(
        self,
        config: RigConfig,
        open_bus: Callable[[RigConfig], Bus],
        beside: bool = True,
        sleep: Callable[[float], None] = time.sleep,
        ports: Sequence[str] = (),
        spare: float = 0.0,
        turns: Callable[[RigConfig], TurnFile | None] = lambda part: TurnFile.of_port(part.port),
    ) -> None:
        """Opens the buses and switches the servos on, each where it stands.

        Args:
            open_bus: opens the bus of the joints of one port, also after the port has vanished.
            beside: whether a recovery runs in a thread beside the loop; otherwise the loop waits for it.
            sleep: how to wait where there is no port to wait on.
            ports: in place of the rig file's own.
            spare: ticks of time that joints keep; see `JointPace`.
            turns: where the turns of the joints on a port are kept; see `ServoPort`.

        Raises:
            RigError, SerialPortError: as `ServoPort` and `RigConfig.on_ports`; torque is taken off again where it was
                on, and joints that did not confirm that are named.
        """
        count = len(config.joints)
        self.config = config
        self.names = config.names
        self.recoveries = 0
        self.faults, self.measured = RigFaults.none(count), Measurements(count)
        servos, self._joint_of = len(config.servos.joints), np.array(config.joint_of)
        by_servo = self.measured if servos == count else Measurements(servos)
        self._joined = None if servos == count else JoinedMeasurements(config, by_servo, self.measured)
        self.positions, self.velocities = self.measured.positions, self.measured.velocities
        self.currents, self.temperatures = self.measured.currents, self.measured.temperatures
        self.voltages = self.measured.voltages
        self.write_us, self.read_us = Timings(), Timings()
        several = np.array([joint.several_turns for joint in config.joints])
        self._several = several if several.any() else None
        self._unseen_for = _UNSEEN_S + _UNSEEN / (config.read_hz or config.rate_hz)
        self._scale = RigScale(config.servos)
        self._stopped = False
        self.turn_keepers: list[TurnKeeper] = []
        opened: list[ServoPort] = []
        try:
            for part in config.on_ports(ports):
                opened.append(ServoPort(config, part, open_bus(part), self._scale, by_servo, self.faults, turns(part)))
        except MotiondeckError as error:
            raise with_torque(error, close_all(opened)) from error
        except BaseException:
            close_all(opened)
            raise
        self._join()
        self.goals = self.positions.copy()
        now = opened[0].bus.port.now()
        self.pace = JointPace(config, RigScale(config), self.measured, now, spare)
        self.health = Health(config, by_servo, now)
        self._port_recoveries: list[PortRecovery] = []
        for port in opened:
            port.left_out, port.goals = self.health.lost, self.goals
            if port.part.through_turns and port.turns is not None:
                self.turn_keepers.append(TurnKeeper(port, port.turns, partial(self._note_port, port)))
            self._port_recoveries.append(PortRecovery(port, self.health, partial(open_bus, port.part), beside, sleep))
        self._keeping = KeeperThread(self.turn_keepers if beside else [])

    @classmethod
    def connect(cls, config: RigConfig, ports: Sequence[str] = (), spare: float = 0.0, emulated: bool = False) -> Rig:
        """Opens the ports of a rig (its file's own, unless others are given) and switches it on.

        Emulated servos have come into being at their zeros, so nothing is kept of their turns. A loop that itself keeps
        the joints' limits in each tick gives them a tick of `spare` time; see `JointPace`.
        """
        # The adapter may come back as another tty; by this name it is found again.
        names = {part.port: lasting_name(part.port) for part in config.on_ports(ports)}
        turns = (lambda part: None) if emulated else (lambda part: TurnFile.of_port(names[part.port]))
        return cls(config, lambda part: Bus.open(names[part.port], part.baud), ports=ports, spare=spare, turns=turns)

    @property
    def states(self) -> ServoStates:
        """The goal, the measurements and the condition of each servo."""
        conditions, measured = self.health.conditions, self.measured
        for port in self._all_ports():
            if port.gone:
                conditions[port.joints] = np.maximum(conditions[port.joints], _NO_ANSWER)
        last = measured.errors, measured.torque, conditions
        return ServoStates(self.goals, self.positions, self.currents, self.temperatures, self.voltages, *last)

    @property
    def busy(self) -> float:
        """For how long the busiest port has been busy with goals and answers since it was opened, s."""
        return max(port.bus.busy for port in self._all_ports())

    @property
    def incidents(self) -> Sequence[Incident]:
        """The latest incidents, each naming its joint or the port, in order of time."""
        return self.health.incidents

    @property
    def report(self) -> RigReport:
        """Counts and durations since the rig was switched on."""
        faults = self.faults
        durations = self.write_us.percentiles, self.read_us.percentiles
        return RigReport(*durations, self.recoveries, faults.total, faults.by_joint(self.names))

    def write(self, targets: Array) -> None:
        """Sends the targets (J,), rad, or as far towards them as the joints' limits allow by now, and requests states.

        A target beyond a limit stops there, one that is NaN or infinite leaves the joint's goal; both are counted.
        """
        ready = self._ready()
        for recovery in self._port_recoveries:
            if self._stopped or recovery.under_way:
                self.faults.unsent[recovery.port.joints] += 1
        if not ready:
            return
        with self.write_us:
            pace = self.pace
            targets, held = self._held_back(targets)
            goals, beyond = pace.bound(targets, self.goals, self.positions, self._now())
            if np.logical_or.reduce(beyond):
                self.faults.clipped[:] += beyond
            counts = self._scale.pulses(goals[self._joint_of])
            for recovery in ready:
                port = recovery.port
                try:
                    if port.write(counts):
                        self.goals[port.joints] = goals[port.joints]
                    else:
                        self.faults.unsent[port.joints] += 1
                except SerialPortError as error:
                    self._recover_port(recovery, error)
            if np.logical_or.reduce(pace.catching_up.joints):
                pace.sent(targets, self.goals, self.positions, held)
                of_servos = pace.of_servos
                for recovery in ready:
                    recovery.port.keep_pace(of_servos)
        for recovery in ready:
            if not recovery.under_way and recovery.port.stopped:
                recovery.start(_RECOVERED_WITHIN)

    def _held_back(self, targets: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The targets, but for joints that stay where they are; and which do."""
        held = ~np.isfinite(targets)
        if np.logical_or.reduce(held):
            self.faults.refused[:] += held
            targets = np.where(held, self.goals, targets)
        if self._several is not None:
            unseen = self.measured.missed_in_a_row >= _UNSEEN
            unseen |= self._now() - self.measured.read_at > self._unseen_for
            unseen &= self._several
            held |= unseen
            targets = np.where(unseen, self.goals, targets)
        if self._joined is not None:
            held |= self._joined.waits
            stay = np.where(np.isnan(self._joined.places), self.goals, self._joined.places)
            targets = np.where(self._joined.waits, stay, targets)
        return targets, held

    def request_state(self) -> None:
        """Requests the servos' states without sending targets."""
        for recovery in self._ready():
            try:
                recovery.port.request_state()
            except SerialPortError as error:
                self._recover_port(recovery, error)

    def collect_state(self) -> bool:
        """Takes the replies that have come in the meantime; whether anything new was measured."""
        ready = self._ready()
        if not ready:
            return False
        fresh, now = False, self._now()
        with self.read_us:
            for recovery in ready:
                try:
                    fresh |= recovery.port.collect_state(now)
                except SerialPortError as error:
                    self._recover_port(recovery, error)
            self._join()
        self._look_after()
        return fresh

    def switch_off(self, joint: int) -> None:
        """Has the torque taken off a joint; the rig goes on without it until `set_up_again`."""
        self.health.take_out(joint, self._now())

    def set_up_again(self, joint: int) -> None:
        """Counts on a joint again: one without torque is set up and switched on where it stands, beside the loop."""
        self.health.take_back(joint, self._now())

    def restart(self, joint: int) -> None:
        """Restarts a joint's servo beside the loop; it is then set up again, and the others of its port hold meanwhile.

        RigError if its model cannot be restarted.
        """
        servo = self.config.joints[joint]
        servo.check_restartable()
        self.health.take_back(joint, self._now())
        self._recovery_of(joint).to_do = lambda bus: [bus.restart(one.id) for one in servo.servos]

    def registers(self, joint: int, write: tuple[str, int] | None = None) -> RegisterReading:
        """Reads all registers of a servo in the loop's next ticks; before that, writes a count into one of them.

        RigError if that is not allowed: see `register_reading`, and the joint must have been switched off.
        """
        servo, measured = self.config.joints[joint], self.measured
        queue = self._recovery_of(joint).port.readings.register_readings
        reading = RegisterReading(joint, servo, write)
        if write is not None and (measured.torque[joint] or not self.health.off[joint]):
            raise RigError(f"registers of {servo.name} are written only while its torque is off: switch it off first.")
        if measured.missed_in_a_row[joint] > 2:
            raise RigError(f"{servo.label} does not answer.")
        if len(queue) >= _MOST_READINGS:
            raise RigError("the registers of several servos are being read already. Try again.")
        queue.append(reading)
        return reading

    def scan(self) -> PortScan:
        """Pings every ID on the ports, beside the loop; all servos hold meanwhile, as when one is restarted.

        RigError if a servo is silent just now, or something else is being done: holding could then end the run.
        """
        if self._stopped or any(recovery.under_way or recovery.to_do is not None for recovery in self._port_recoveries):
            raise RigError("the rig is busy with its servos. Try again.")
        if np.logical_or.reduce((self.measured.missed_in_a_row > 0) & ~self.health.lost):
            raise RigError("a servo does not answer just now. Try again when the rig has recovered or given up on it.")
        scan = PortScan(self.config.servos, len(self._port_recoveries))
        for recovery in self._port_recoveries:
            recovery.to_do = partial(scan.ask, recovery.port.servos)
        return scan

    def close(self, *, hold: bool = False) -> list[str]:
        """Switches off, or holds, as the rig file asks or as given; returns the joints that did not confirm it."""
        self._stopped = True
        self._keeping.stop()
        for recovery in self._port_recoveries:
            recovery.cancelled = True
        try:
            for recovery in self._port_recoveries:
                recovery.wait()
        finally:
            unconfirmed = close_all(self._all_ports(), hold=hold)
        return unconfirmed

    def _join(self) -> None:
        if self._joined is not None:
            self._joined.update()

    def _now(self) -> float:
        return self._port_recoveries[0].port.bus.port.now()

    def _all_ports(self) -> list[ServoPort]:
        return [recovery.port for recovery in self._port_recoveries]

    def _recovery_of(self, joint: int) -> PortRecovery:
        return next(recovery for recovery in self._port_recoveries if joint in recovery.port.joints)

    def _ready(self) -> list[PortRecovery]:
        """The ports in use; takes back those whose recovery is over, and raises RigError where it has failed."""
        if self._stopped:
            return []
        ready: list[PortRecovery] = []
        for recovery in self._port_recoveries:
            if recovery.under_way and recovery.over:
                self._take_back(recovery)
            if not recovery.under_way:
                ready.append(recovery)
        return ready

    def _take_back(self, recovery: PortRecovery) -> None:
        recovered, port, now = recovery.take(), recovery.port, self._now()
        if recovered is None and self._goes_on_without(recovery, now):
            return
        if recovered is None:
            self._stopped = True
            raise RigError(f"the rig has stopped: {recovery.failure}") from recovery.failure
        if port.gone:
            self._note_port(port, "is back", fault=False)
        port.attach(recovered, now)
        self._join()
        joints, firsts = np.unique(port.joint_of[recovered.rows], return_index=True)  # of two servos the first counts
        self.goals[joints] = recovered.held.angles[firsts]
        self.recoveries += 1
        self.health.recovered(port.joints, now)
        self.pace.start_again(port.joints, now)
        port.keep_pace(self.pace.of_servos)
        self._loosen(self.health.lost)

    def _goes_on_without(self, recovery: PortRecovery, now: float) -> bool:
        """Gives up on servos that failed while the others of their port were set up again, which starts anew.

        Whether it does: the rig file must ask for it, and others be left.
        """
        if self.config.on_loss == "stop" or not isinstance(recovery.failure, LostServosError):
            return False
        failed = [index for index in recovery.port.joints.tolist() if self.names[index] in recovery.failure.names]
        if len(failed) == np.count_nonzero(~self.health.lost[recovery.port.joints]):
            return False
        self.health.miss(failed, recovery.failure.what, now)
        recovery.start(_RECOVERED_WITHIN)
        return True

    def _recover_port(self, recovery: PortRecovery, error: SerialPortError) -> None:
        """Starts to reopen a port that has vanished; raises RigError if the rig file does not want that."""
        recovery.port.gone = True
        self._note_port(recovery.port, "is gone")
        if self.config.reconnect_s == 0.0:
            self._stopped = True
            raise RigError(f"the rig has stopped: {error}") from error
        recovery.start(self.config.reconnect_s)

    def _note_port(self, port: ServoPort, what: str, *, fault: bool = True) -> None:
        self.health.incidents.append(Incident(self._now(), f"the port {port.part.port}", what, fault))

    def _look_after(self) -> None:
        """Eases hot joints, has joints recovered, and stops the rig (RigError) for a lost one or goes on without it."""
        recovering = [recovery.port.joints for recovery in self._port_recoveries if recovery.under_way]
        if len(recovering) == len(self._port_recoveries):
            return
        health, measured, now = self.health, self.measured, self._now()
        self.pace.strain.note(measured.currents, now, measured.alone)
        self.pace.ease.note(measured.temperatures, measured.voltages)
        health.look(measured, self.goals, self.pace.strain.yielding, recovering, now)
        if np.logical_or.reduce(health.fatal):
            if self.config.on_loss == "stop" or any(self._has_lost_all(port) for port in self._all_ports()):
                self._stopped = True
                raise RigError(f"the rig has stopped: {health.reasons}. Mend the cause and start anew.")
            health.give_up(now)
            self._loosen(health.lost)
        held_on = health.off & measured.torque
        if np.logical_or.reduce(held_on):
            self._loosen(held_on)
        for recovery in self._port_recoveries:
            wanted = recovery.to_do is not None or np.logical_or.reduce(health.mend[recovery.port.joints])
            if wanted and not recovery.under_way:
                recovery.start(_RECOVERED_WITHIN)

    def _has_lost_all(self, port: ServoPort) -> bool:
        """Whether the last joint of a port is lost just now; one of which all were switched off does no harm."""
        fatal, lost = self.health.fatal[port.joints], self.health.lost[port.joints]
        return bool(fatal.any() and (fatal | lost).all())

    def _loosen(self, joints: NDArray[np.bool_]) -> None:
        for recovery in self._port_recoveries:
            if not recovery.under_way:
                try:
                    recovery.port.loosen(joints)
                except SerialPortError as error:
                    self._recover_port(recovery, error)
