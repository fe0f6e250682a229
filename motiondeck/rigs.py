# pyright: strict
"""Servo rigs: joint angles in, joint angles out; on a real port, on an emulated one, or simulated in this process."""

import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from controller.motion.quintic import rise
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.process import start_emulator
from hardware.emulator.pty_server import SimulatedPort
from hardware.errors import RigError, still_on
from hardware.rig.rig_file import RigConfig, load_rig
from hardware.rig.scale import RigScale
from hardware.rig.supervision.rig import Rig as ConnectedRig
from motiondeck_base.errors import UnknownNameError
from motiondeck_base.shipped import find_rig

__all__ = ["Rig", "open_rig"]

Array = NDArray[np.float64]
Servos = Literal["real", "emulated", "simulated"]
SERVOS: tuple[Servos, ...] = ("real", "emulated", "simulated")

_ANSWERS_WITHIN = 0.2  # s
_LOOK_AGAIN = 0.5e-3  # s


class Rig:
    """A rig that is switched on, each servo where it stands; made by `open_rig`.

    Every target is kept within the limits of the rig file (`config`), `lower` and `upper`, shape (J,), rad, in the
    order of `joints`; the servos keep to its speed limits themselves. When nothing is heard for the rig file's
    `watchdog_ms` the servos stop: write, read or `wait` at least that often.
    """

    def __init__(self, connected: ConnectedRig, simulated: Sequence[SimulatedPort] = ()) -> None:
        self._rig, self._simulated = connected, simulated
        self.config: RigConfig = connected.config
        self.joints = connected.names
        self._scale = RigScale(self.config)
        self.lower, self.upper = self._scale.lower, self._scale.upper
        self._goal: Array = connected.positions.copy()
        self._due = time.monotonic()

    def read(self) -> Array:
        """The measured joint positions, shape (J,), rad.

        RigError if no servo answers in time, or the rig has stopped for good; it names the servo.
        """
        rig = self._rig
        deadline = time.monotonic() + _ANSWERS_WITHIN
        rig.collect_state()  # an answer to an earlier question is older than this call
        rig.request_state()
        while not rig.collect_state():
            if time.monotonic() > deadline:
                raise RigError("no servo of the rig answers. Check its power and cable: motiondeck rig doctor")
            time.sleep(_LOOK_AGAIN)
        return rig.positions.copy()

    def write(self, angles: ArrayLike | Mapping[str, float]) -> None:
        """Sends targets, shape (J,), rad, or those of some joints by name; returns at once.

        UnknownNameError if there is no such joint; it names the nearest. RigError if the shape is wrong, an angle is
        not finite, or the rig has stopped for good.
        """
        goal = self._targets(angles)
        self._rig.write(goal)
        self._goal = goal

    def wait(self, seconds: float) -> None:
        """Waits and feeds the servos' watchdogs; a simulated rig returns at once.

        Successive calls keep a steady pace: a loop of `write` and `wait(0.01)` runs at 100 Hz, whatever else it does.
        RigError if the time is not >= 0.
        """
        if not 0.0 <= seconds < np.inf:
            raise RigError(f"wait: seconds must be >= 0, not {seconds:g}")
        rig = self._rig
        if self._simulated:
            ticks = max(1, round(seconds * self.config.rate_hz))
            for _ in range(ticks):
                rig.collect_state()
                rig.write(self._goal)
                for line in self._simulated:
                    line.elapse(seconds / ticks)
            return
        now = time.monotonic()
        due = self._due = (self._due if now - self._due < seconds else now) + seconds
        while (left := due - time.monotonic()) > 0.0:
            rig.collect_state()
            rig.request_state()
            time.sleep(min(left, 1.0 / self.config.rate_hz))

    def move_to(self, angles: ArrayLike | Mapping[str, float], seconds: float = 2.0) -> None:
        """Moves smoothly from the present targets to others, given as for `write`, and returns when the time is over.

        Position, speed and acceleration have no jump. UnknownNameError and RigError as `write`, or if the time is not
        above 0 s.
        """
        if not 0.0 < seconds < np.inf:
            raise RigError(f"move_to: seconds must be > 0, not {seconds:g}")
        start, end = self._goal, self._targets(angles)
        steps = max(1, round(seconds * self.config.rate_hz))
        for step in range(1, steps + 1):
            self.write(start + rise(step / steps) * (end - start))
            self.wait(seconds / steps)

    def _targets(self, angles: ArrayLike | Mapping[str, float]) -> Array:
        if not isinstance(angles, Mapping):
            targets = np.array(angles, dtype=np.float64)
            if targets.shape != (len(self.joints),):
                raise RigError(f"targets of shape {targets.shape}; a rig of {len(self.joints)} joints takes one each")
        else:
            targets = self._goal.copy()
            for joint, angle in angles.items():
                if joint not in self.joints:
                    raise UnknownNameError.among("joint", str(joint), self.joints)
                targets[self.joints.index(joint)] = angle
        for joint, angle in zip(self.joints, targets, strict=True):
            if not np.isfinite(angle):
                raise RigError(f"joint '{joint}': a target of {angle} is not an angle in rad")
        return self._scale.within(targets)


@contextmanager
def open_rig(name: str | Path, servos: Servos = "real", ports: Sequence[str] = ()) -> Generator[Rig, None, None]:
    """Connects a rig for the length of a `with` block and switches its servos on where they stand.

    Afterwards torque is switched off, or the joints are held, as the rig file says. MotiondeckError if the file is
    wrong, a port cannot be opened, or a servo is missing or unfit; it names them. One after the block if joints did not
    confirm that their torque is off.

    Args:
        name: a shipped rig ("servo20"), or the path of a rig file (.toml).
        servos: "real" on a serial port, "emulated" on a pseudo-terminal with every byte of the protocol, or "simulated"
            in this process without a port or waiting, for tests and fast trials.
        ports: in place of the rig file's own, for real servos.
    """
    UnknownNameError.check("kind of servos", servos, SERVOS)
    file = find_rig(name)
    config = load_rig(file)
    lines = dict[str, SimulatedPort]()
    with ExitStack() as opened:
        if servos == "simulated":
            lines |= {part.port: SimulatedPort(EmulatedBus(part)) for part in config.parts}
            buses = {name: Bus(line, config.baud) for name, line in lines.items()}
            connected = ConnectedRig(config, lambda part: buses[part.port], beside=False, turns=lambda part: None)
        elif servos == "emulated":
            connected = ConnectedRig.connect(config, opened.enter_context(start_emulator(file)).ports, emulated=True)
        else:
            connected = ConnectedRig.connect(config, ports)
        try:
            yield Rig(connected, tuple(lines.values()))
        except BaseException as error:
            if unconfirmed := connected.close():
                error.add_note(still_on(unconfirmed))
            raise
        if unconfirmed := connected.close():
            raise RigError(still_on(unconfirmed))
