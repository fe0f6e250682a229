"""Recovery of one port beside the loop, which goes on with the other ports meanwhile.

The port is opened if it is gone; then every servo is verified, set up and switched on where it stands, again and again
until it works or the time is over.
"""

import threading
from collections.abc import Callable

import numpy as np

from hardware.bus.servo_bus import Bus
from hardware.errors import MotiondeckError, RigError, SerialPortError
from hardware.rig.driving.servo_port import Prepared, ServoPort
from hardware.rig.supervision.health import Health
from hardware.rig.supervision.pace import SLOWER
from hardware.rig.switching.torque import resume

_PAUSE = 0.05  # s between two tries


class PortRecovery:
    """The recovery of one port."""

    def __init__(
        self, port: ServoPort, health: Health, open_bus: Callable[[], Bus], beside: bool, sleep: Callable[[float], None]
    ) -> None:
        """Does nothing yet; without `beside` the loop waits for it."""
        self.port, self._health, self._open_bus = port, health, open_bus
        self._beside, self._sleep = beside, sleep
        self.under_way = False  # whether it runs, or its result was not taken yet
        self.cancelled = False  # set to end it as soon as possible; see `wait`
        self._recovered: Prepared | None = None
        self.failure: MotiondeckError | None = None  # why the last try has failed
        self.to_do: Callable[[Bus], object] | None = None  # another task that waits for answers; it is done first
        self.job: threading.Thread | None = None

    def start(self, patience: float) -> None:
        """Starts, for at most `patience` seconds."""
        self.under_way = True
        self.failure = self._recovered = None
        if not self._beside:
            self._recover(patience)
        else:
            self.job = threading.Thread(target=self._recover, args=(patience,), name="rig-recovery", daemon=True)
            self.job.start()

    @property
    def over(self) -> bool:
        """Whether it has ended, well or not."""
        return self.job is None or not self.job.is_alive()

    def take(self) -> Prepared | None:
        """The result; None if it failed."""
        self.under_way, self.job = False, None
        recovered, self._recovered = self._recovered, None
        return recovered

    def wait(self) -> None:
        """Waits for the end, before which it could still switch something on."""
        if self.job is not None:
            self.job.join()  # each of its waits for an answer has an end

    def _recover(self, patience: float) -> None:
        port = self.port
        gone = port.gone
        waited, began = 0.0, port.bus.port.now()
        to_do, self.to_do = self.to_do, None
        while not self.cancelled:
            try:
                if gone:
                    port.bus.close()
                    # Given to the port at once, so that `close` always switches off over the port that is open.
                    port.bus, gone = self._open_bus(), False
                    port.bus.families = port.part.families
                if to_do is not None:
                    do, to_do = to_do, None
                    do(port.bus)
                places = np.flatnonzero(~self._health.lost[port.joints]).tolist()
                alive = port.part.only(places).servos
                own = [port.servos.names.index(name) for name in alive.names]
                held = resume(alive, port.bus, port.believed[:, own], SLOWER, lambda: self.cancelled)
                self._recovered = port.prepare(alive, port.rows[own].tolist(), held)
                return
            except MotiondeckError as error:
                self.failure = error
                gone = gone or isinstance(error, SerialPortError)
            except Exception as error:  # whatever ends the thread must reach the loop
                self.failure = RigError(f"{type(error).__name__}: {error}")
                return
            self._sleep(_PAUSE)
            waited += _PAUSE
            if max(waited, port.bus.port.now() - began) >= patience:
                return
