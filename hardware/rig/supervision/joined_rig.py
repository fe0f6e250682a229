"""A rig on several ports as one: each port has its own supervised rig, and they are written and read side by side.

Nothing waits, so the ports carry their bytes at the same time. Where one part stops for good, so does the whole: no
part is given targets any more, and the watchdogs of the others stop them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import fields
from types import TracebackType
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from hardware.errors import MotiondeckError, RigError, with_torque
from hardware.rig.driving.register_reading import RegisterReading
from hardware.rig.faults import RigFaults
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array
from hardware.rig.supervision.health import Incident
from hardware.rig.supervision.servo_states import ServoStates
from hardware.rig.supervision.supervised_rig import SupervisedRig
from hardware.rig.switching.port_scan import PortScan
from hardware.rig.timings import Timings


class JoinedRig:
    """Parts that are switched on; arrays follow the order of the rig file's joints. Fits `hardware.rig.interface.Rig`.

    Attributes:
        config: the whole rig file.
        names: of the joints.
        write_us, read_us: how long each `write` and each `collect_state` took.
    """

    def __init__(self, config: RigConfig, parts: Sequence[SupervisedRig]) -> None:
        """Joins the rigs of `config.parts`, in that order."""
        self.config = config
        self.names = config.names
        self.write_us, self.read_us = Timings(), Timings()
        self._parts = [(part, np.array([self.names.index(name) for name in part.names])) for part in parts]
        self._lost = False

    def __enter__(self) -> JoinedRig:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def positions(self) -> Array:
        """Last measured, shape (J,), rad."""
        return self._joined([part.positions for part, _ in self._parts])

    @property
    def velocities(self) -> Array:
        """Last measured, shape (J,), rad/s."""
        return self._joined([part.velocities for part, _ in self._parts])

    @property
    def currents(self) -> Array:
        """Last measured, shape (J,), A."""
        return self._joined([part.currents for part, _ in self._parts])

    @property
    def temperatures(self) -> Array:
        """Last measured, shape (J,), degC; NaN until first read."""
        return self._joined([part.temperatures for part, _ in self._parts])

    @property
    def voltages(self) -> Array:
        """Last measured supply voltages, shape (J,), V; NaN until first read."""
        return self._joined([part.voltages for part, _ in self._parts])

    @property
    def states(self) -> ServoStates:
        """What each servo does now."""
        parts = [part.states for part, _ in self._parts]
        return ServoStates(*(self._joined([*values]) for values in zip(*parts, strict=True)))

    @property
    def incidents(self) -> Sequence[Incident]:
        """The latest incidents of all parts, in order of time."""
        return sorted(incident for part, _ in self._parts for incident in part.incidents)

    @property
    def recoveries(self) -> int:
        """How often something was mended."""
        return sum(part.recoveries for part, _ in self._parts)

    @property
    def faults(self) -> RigFaults:
        """What went wrong so far."""
        joined = RigFaults.none(len(self.names))
        for part, places in self._parts:
            for field in fields(joined):
                getattr(joined, field.name)[places] = getattr(part.faults, field.name)
        return joined

    def write(self, targets: Array) -> None:
        """Sends the targets (J,), rad, and asks for the state; see `SupervisedRig.write`.

        Raises:
            RigError: when a part has stopped for good, once.
        """
        with self.write_us, self._all_or_none() as parts:
            for part, places in parts:
                part.write(targets[places])

    def request_state(self) -> None:
        """Asks the servos for their state without giving them targets; see `SupervisedRig.request_state`."""
        with self._all_or_none() as parts:
            for part, _ in parts:
                part.request_state()

    def collect_state(self) -> bool:
        """Takes the answers that have come in the meantime; whether anything new was measured."""
        fresh = False
        with self.read_us, self._all_or_none() as parts:
            for part, _ in parts:
                fresh |= part.collect_state()
        return fresh

    def switch_off(self, joint: int) -> None:
        """Takes the torque off a joint; see `SupervisedRig.switch_off`."""
        part, place = self._part_of(joint)
        part.switch_off(place)

    def set_up_again(self, joint: int) -> None:
        """Counts on a joint again; see `SupervisedRig.set_up_again`."""
        part, place = self._part_of(joint)
        part.set_up_again(place)

    def restart(self, joint: int) -> None:
        """Restarts a joint's servo; see `SupervisedRig.restart`."""
        part, place = self._part_of(joint)
        part.restart(place)

    def registers(self, joint: int, write: tuple[str, int] | None = None) -> RegisterReading:
        """Reads all registers of a joint's servo; see `SupervisedRig.registers`."""
        part, place = self._part_of(joint)
        return part.registers(place, write)

    def scan(self) -> PortScan:
        """Asks who is on the ports; see `SupervisedRig.scan`."""
        return PortScan(self.config, [part.scan() for part, _ in self._parts])

    def close(self) -> list[str]:
        """Ends all parts, also twice (see `SupervisedRig.close`); returns the joints that did not confirm it."""
        return _close_all([part for part, _ in self._parts])

    @contextmanager
    def _all_or_none(self) -> Iterator[list[tuple[SupervisedRig, NDArray[np.int64]]]]:
        """The parts with their places; none any more once one of them has stopped."""
        try:
            yield [] if self._lost else self._parts
        except RigError:
            self._lost = True
            raise

    def _part_of(self, joint: int) -> tuple[SupervisedRig, int]:
        """The part that has a joint, and its place there."""
        part, places = next(found for found in self._parts if joint in found[1])
        return part, int(np.flatnonzero(places == joint)[0])

    def _joined(self, values: list[NDArray[Any]]) -> NDArray[Any]:
        """The values of the parts in the order of the rig file."""
        joined = np.empty(len(self.names), values[0].dtype)
        for (_, places), own in zip(self._parts, values, strict=True):
            joined[places] = own
        return joined


def on_ports(config: RigConfig, ports: Sequence[str] = ()) -> tuple[RigConfig, ...]:
    """The parts of a rig, on these ports instead of the rig file's own if there are any.

    Raises:
        RigError: if another number of ports is given than the rig has.
    """
    parts = config.parts
    if not ports:
        return parts
    if len(ports) != len(parts):
        raise RigError(f"the rig has {len(parts)} ports ({', '.join(config.ports)}), {len(ports)} were given.")
    return tuple(msgspec.structs.replace(part, port=port) for part, port in zip(parts, ports, strict=True))


def connect_rig(config: RigConfig, ports: Sequence[str] = ()) -> SupervisedRig | JoinedRig:
    """Opens the ports of a rig (its file's own, unless others are given) and switches it on.

    Raises:
        RigError: as `DynamixelRig` and `on_ports`; torque is taken off again where it was on, and joints that did not
            confirm that are named.
        SerialPortError: if a port cannot be opened, or vanishes; the same.
    """
    rigs: list[SupervisedRig] = []
    try:
        for part in on_ports(config, ports):
            rigs.append(SupervisedRig.connect(part))
    except MotiondeckError as error:
        raise with_torque(error, _close_all(rigs)) from error
    except BaseException:
        _close_all(rigs)
        raise
    return rigs[0] if len(rigs) == 1 else JoinedRig(config, rigs)


def _close_all(rigs: Sequence[SupervisedRig]) -> list[str]:
    """Closes every rig, also after one has failed; returns the joints that did not confirm it."""
    unconfirmed: list[str] = []

    def close(rig: SupervisedRig) -> None:
        try:
            unconfirmed.extend(rig.close())
        except Exception:  # the torque that is left on matters more than what went wrong
            unconfirmed.extend(rig.names)

    with ExitStack() as closing:
        for rig in reversed(rigs):
            closing.callback(close, rig)
    return unconfirmed
