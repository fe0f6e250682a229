"""A rig that looks after itself while a loop drives it: it eases hot and strained joints, and mends what can be.

    the bus was silent too long      the watchdogs are cleared; the joints start again from where they stand
    a servo was silent for so long   the same: its own watchdog has stopped it, and it takes no goals
    a servo has restarted            it is checked, set up and switched on again where it stands
    the port vanished                it is looked for, and every servo's identity and settings are verified first
    a servo is silent or shut down   the rig stops and names it, or goes on without it, as the rig file says

After each of these the joints catch up with their targets at a quarter of their speed limits. What waits for answers
runs beside the loop, never in it; meanwhile nothing is sent, so the servos' own watchdogs hold them still.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from hardware.bus.servo_bus import Bus
from hardware.errors import MotiondeckError, RigError, SerialPortError
from hardware.rig.dynamixel_rig import WATCHDOG_UNIT, DynamixelRig
from hardware.rig.faults import RigFaults
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array
from hardware.rig.strain import Strain
from hardware.rig.switching import describe_errors, resume
from hardware.rig.timings import Timings

_LOST_AFTER = 1.6  # s of silence of one servo
_MENDED_WITHIN = 2.0  # s, for all but a vanished port
_PAUSE = 0.05  # s between two attempts
_CATCHING_UP = 0.25  # of the speed limit
_CAUGHT_UP = 0.02  # rad
_EASED_FROM, _EASED_TO = 12.0, 2.0  # degC below the servo's limit: full speed, least speed
_LEAST = 0.25  # of the speed limit
_LONGEST_STEP = 0.1  # s


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
        self._hottest = np.array([joint.hottest for joint in config.joints])
        self._ease = np.ones(len(self.names))
        self._strain = Strain(config)
        self._catching_up = np.zeros(len(self.names), dtype=np.bool_)
        self._last_write = self._rig.now()
        self._heard = np.full(len(self.names), self._last_write)
        self._missing = np.zeros(len(self.names), dtype=np.bool_)
        self._job: threading.Thread | None = None
        self._mending = self._stopped = False
        self._failure: MotiondeckError | None = None
        self._new_bus: tuple[Bus, Array] | None = None

    @classmethod
    def connect(cls, config: RigConfig) -> SupervisedRig:
        """Opens the port of a rig that has only one (see `joined_rig.connect_rig`) and switches the rig on.

        Raises:
            RigError: as `DynamixelRig`.
            SerialPortError: if the port cannot be opened, or vanishes.
        """
        return cls(config, lambda: Bus.open(config.port, config.baud))

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
        """Last measured, shape (J,), degC; NaN where the loop does not read them."""
        return self._rig.temperatures

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
        """How long each `request_state` and `collect_state` took."""
        return self._rig.read_us

    @property
    def easing(self) -> Array:
        """The part of its speed limit that each joint may use now, shape (J,)."""
        return np.where(self._catching_up, np.minimum(self._ease, _CATCHING_UP), self._ease)

    @property
    def yielding(self) -> NDArray[np.bool_]:
        """Which joints push against something and give way, shape (J,)."""
        return self._strain.yielding

    @property
    def mending(self) -> bool:
        """Whether the rig is being brought back, and takes no targets."""
        return self._mending

    def write(self, targets: Array) -> None:
        """Sends the targets (J,), rad; see `DynamixelRig.write`."""
        if not self._ready():
            self._rig.faults.unsent[:] += 1
            return
        with self._mend_what_breaks():
            self._rig.write(self._eased(targets))
        if not self._mending and self._rig.stopped:
            self._mend(_MENDED_WITHIN)

    def request_state(self) -> None:
        """Asks the servos for their state; see `DynamixelRig.request_state`."""
        if self._ready():
            with self._mend_what_breaks():
                self._rig.request_state()

    def collect_state(self) -> bool:
        """Takes the answer if it has come in the meantime; whether anything new was measured."""
        if not self._ready():
            return False
        fresh = False
        with self._mend_what_breaks():
            fresh = self._rig.collect_state()
        if not self._mending:
            self._look_after()
        return fresh

    def close(self) -> list[str]:
        """Ends it as the rig file says; may be called twice.

        Returns:
            The joints that did not confirm it.
        """
        self._stopped = True
        if self._job is not None:
            # Each of its waits for an answer has an end; before that it could still switch something on.
            self._job.join()
            if self._new_bus is not None:
                self._rig.attach(*self._new_bus)
        return self._rig.close()

    def _ready(self) -> bool:
        """Whether the rig takes and gives anything now; ends a mending that is over.

        Raises:
            RigError: if mending has failed.
        """
        if self._mending and (self._job is None or not self._job.is_alive()):
            self._mending, self._job = False, None
            if self._new_bus is None:
                self._stopped = True
                raise RigError(f"the rig has stopped: {self._failure}") from self._failure
            self._rig.attach(*self._new_bus)
            self._new_bus = None
            self.recoveries += 1
            self._heard[:] = self._last_write = self._rig.now()
            self._catching_up[:] = True
        return not (self._mending or self._stopped)

    @contextmanager
    def _mend_what_breaks(self) -> Iterator[None]:
        """A block in which a vanished port starts a recovery."""
        try:
            yield
        except SerialPortError as error:
            if self.config.reconnect_s == 0.0:
                self._stopped = True
                raise RigError(f"the rig has stopped: {error}") from error
            self._mend(self.config.reconnect_s)

    def _mend(self, patience: float) -> None:
        """Starts to bring the rig back, for at most so long, s."""
        self._mending = True
        self._failure = self._new_bus = None
        if not self._beside:
            self._bring_back(patience)
        else:
            self._job = threading.Thread(target=self._bring_back, args=(patience,), name="rig-mending", daemon=True)
            self._job.start()

    def _bring_back(self, patience: float) -> None:
        """Opens the port if it is gone, verifies the servos and has them hold; again and again until it works."""
        bus = None if self._rig.gone else self._rig.bus
        waited, began = 0.0, time.monotonic()
        while not self._stopped:
            try:
                if bus is None:
                    self._rig.bus.close()
                    # The rig's own at once: whatever comes of it, `close` switches off over the port that is open.
                    self._rig.bus = bus = self._open_bus()
                self._new_bus = (bus, resume(self.config, bus, lambda: self._stopped))
                return
            except MotiondeckError as error:
                self._failure = error
                if isinstance(error, SerialPortError):
                    bus = None
            except Exception as error:  # nothing may leave the thread unsaid
                self._failure = RigError(f"{type(error).__name__}: {error}")
                return
            self._sleep(_PAUSE)
            waited += _PAUSE
            if max(waited, time.monotonic() - began) >= patience:
                return

    def _eased(self, targets: Array) -> Array:
        """The targets, held back where a joint is hot or has to catch up."""
        now = self._rig.now()
        step = self._speed * min(_LONGEST_STEP, max(0.0, now - self._last_write))
        self._last_write = now
        strain = self._strain
        if strain.yielding.any():
            here = self._rig.positions
            near = np.clip(targets, here - strain.reach, here + strain.reach)
            targets = np.where(strain.yielding, near, targets)
            self._catching_up |= strain.yielding
        easing = self.easing
        if (easing >= 1.0).all():
            return targets
        goals = self._rig.goals
        held = np.where(
            (easing < 1.0) & ~strain.yielding, goals + np.clip(targets - goals, -easing * step, easing * step), targets
        )
        self._catching_up &= strain.yielding | ~(np.abs(targets - held) < _CAUGHT_UP)
        return held

    def _look_after(self) -> None:
        """Eases hot joints, and notices servos that have restarted, shut down, or fallen silent.

        Raises:
            RigError: if the rig must stop because of one.
        """
        rig, now = self._rig, self._rig.now()
        known = np.isfinite(rig.temperatures)
        margin = np.where(known, self._hottest - rig.temperatures, np.inf)
        self._strain.note(rig.currents, now)
        self._ease = np.clip((margin - _EASED_TO) / (_EASED_FROM - _EASED_TO), _LEAST, 1.0)
        missing = rig.missed_in_a_row > 0
        # Who was cut off for longer than its watchdog's time may have been stopped by it, alone and without a word.
        back = self._missing & ~missing & (now - self._heard > self.config.watchdog_ms * 1e-3 - WATCHDOG_UNIT)
        self._missing = missing
        self._heard[~missing] = now
        down = ~rig.torque & (rig.errors != 0)
        silent = now - self._heard > _LOST_AFTER
        if self.config.on_loss == "stop" and (down | silent).any():
            self._stopped = True
            raise RigError(f"the rig has stopped: {self._who(down, silent)}. Mend the cause and start anew.")
        if (back | (~rig.torque & (rig.errors == 0) & ~silent)).any():
            self._mend(_MENDED_WITHIN)

    def _who(self, down: NDArray[np.bool_], silent: NDArray[np.bool_]) -> str:
        """The servos that stop the rig, and why."""
        who = [f"{joint.name} (id {joint.id})" for joint in self.config.joints]
        errors = [describe_errors(int(bits)) for bits in self._rig.errors]
        said = [f"{who[index]} has shut down: {errors[index]}" for index in np.flatnonzero(down).tolist()]
        said += [f"{who[index]} does not answer" for index in np.flatnonzero(silent).tolist()]
        return "; ".join(said)
