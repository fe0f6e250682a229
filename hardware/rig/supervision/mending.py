"""Mending: brings a rig back beside the loop, which goes on without it meanwhile.

The port is opened if it is gone; then every servo is verified, set up and switched on where it stands, again and again
until it works or the time is over.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hardware.bus.servo_bus import Bus
from hardware.errors import MotiondeckError, RigError, SerialPortError
from hardware.rig.driving.dynamixel_rig import DynamixelRig
from hardware.rig.driving.indirect_cells import arrange_state
from hardware.rig.driving.state_block import StateBlock
from hardware.rig.scale import Array
from hardware.rig.supervision.catching_up import SLOWER
from hardware.rig.supervision.health import Health
from hardware.rig.switching.torque import resume

_PAUSE = 0.05  # s between two tries


class Mended(NamedTuple):
    """What mending has brought back; the arguments of `DynamixelRig.attach`."""

    bus: Bus
    joints: list[int]
    held: Array
    blocks: list[StateBlock]


class Mending:
    """What is done to one rig beside the loop.

    Attributes:
        under_way: whether the rig is being mended, or what has come of it was not taken yet.
        mended: what was brought back; None until then.
        failure: why the last try has failed.
        to_do: what else waits for answers, and so is done then.
        job: the thread.
    """

    def __init__(
        self,
        rig: DynamixelRig,
        health: Health,
        open_bus: Callable[[], Bus],
        beside: bool,
        sleep: Callable[[float], None],
    ) -> None:
        """Mends nothing yet; without `beside` the loop waits for it."""
        self._rig, self._health, self._open_bus = rig, health, open_bus
        self._beside, self._sleep = beside, sleep
        self._given_up = self.under_way = False
        self.mended: Mended | None = None
        self.failure: MotiondeckError | None = None
        self.to_do: Callable[[Bus], object] | None = None
        self.job: threading.Thread | None = None

    def start(self, patience: float) -> None:
        """Starts to bring the rig back, for at most so long, s."""
        self.under_way = True
        self.failure = self.mended = None
        if not self._beside:
            self._bring_back(patience)
        else:
            self.job = threading.Thread(target=self._bring_back, args=(patience,), name="rig-mending", daemon=True)
            self.job.start()

    @property
    def over(self) -> bool:
        """Whether it has ended, well or not."""
        return self.job is None or not self.job.is_alive()

    def take(self) -> Mended | None:
        """Takes what was brought back, if anything was."""
        self.under_way, self.job = False, None
        mended, self.mended = self.mended, None
        return mended

    def stop(self) -> None:
        """Gives up, and waits for that: before it could still switch something on."""
        self._given_up = True
        if self.job is not None:
            self.job.join()  # each of its waits for an answer has an end

    def _bring_back(self, patience: float) -> None:
        bus = None if self._rig.gone else self._rig.bus
        waited, began = 0.0, self._rig.now()
        to_do, self.to_do = self.to_do, None
        while not self._given_up:
            try:
                if bus is None:
                    self._rig.bus.close()
                    # The rig's own at once, so that `close` always switches off over the port that is open.
                    self._rig.bus = bus = self._open_bus()
                    bus.old = self._rig.config.old_ids
                if to_do is not None:
                    do, to_do = to_do, None
                    do(bus)
                joints = np.flatnonzero(~self._health.lost).tolist()
                alive = self._rig.config.only(joints)
                held = resume(alive, bus, SLOWER, lambda: self._given_up)
                self.mended = Mended(bus, joints, held, arrange_state(alive, bus))
                return
            except MotiondeckError as error:
                self.failure = error
                if isinstance(error, SerialPortError):
                    bus = None
            except Exception as error:  # whatever ends the thread must reach the loop
                self.failure = RigError(f"{type(error).__name__}: {error}")
                return
            self._sleep(_PAUSE)
            waited += _PAUSE
            if max(waited, self._rig.now() - began) >= patience:
                return
