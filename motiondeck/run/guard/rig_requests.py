"""What a deck asks of the servos of a rig beside their targets, carried out on the rig in the guard."""

from __future__ import annotations

from collections.abc import Iterator

from hardware.rig.driving.register_reading import RegisterReading
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.identities import PortScan
from motiondeck.run.guard import messages
from motiondeck.run.guard.messages import Begin, Note, Request
from motiondeck_base.errors import MotiondeckError


class RigRequests:
    """Requests to a rig; none waits, and the answers come when the servos have replied."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._readings: list[tuple[int, RegisterReading]] = []
        self._scans: list[tuple[int, PortScan]] = []
        self._refused: list[Note] = []

    def take(self, request: Request) -> None:
        """Starts what a request asks for."""
        rig = self._rig
        match request:
            case messages.SwitchTorque(joint=joint, on=on):
                if on:
                    rig.set_up_again(joint)
                else:
                    rig.switch_off(joint)
            case messages.Restart(joint=joint):
                rig.restart(joint)
            case messages.QueryRegisters(number=number, joint=joint, write=write):
                try:
                    self._readings.append((number, rig.registers(joint, write)))
                except MotiondeckError as error:
                    self._refused.append(messages.RegistersRead(number, {}, str(error)))
            case messages.QueryPorts(number=number):
                try:
                    self._scans.append((number, rig.scan()))
                except MotiondeckError as error:
                    self._refused.append(messages.Scanned(number, [], [], str(error)))
            case Begin() | messages.WatchStops() | messages.QueryReport() | messages.CloseRig():
                pass  # the process has them

    def answers(self) -> Iterator[Note]:
        """The answers that have come since the last call."""
        while self._refused:
            yield self._refused.pop(0)
        for waiting in [one for one in self._readings if one[1].done]:
            self._readings.remove(waiting)
            number, reading = waiting
            yield messages.RegistersRead(number, reading.counts, reading.failure)
        for number, scan in self._scans:
            if scan.found is not None:
                found = [(joint, one.id, one.model, one.firmware) for joint, one in scan.found]
                yield messages.Scanned(number, found, scan.missing, "")
        self._scans = [one for one in self._scans if one[1].found is None]
