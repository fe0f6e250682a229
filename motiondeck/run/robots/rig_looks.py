"""Looks at servos, as replies to the commands that asked for them; fit `controller.loop.commands.interfaces.Look`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from controller.wire.messages.replies import OnPorts, Refused, Registers, ServoOnPort, ServoRegister

if TYPE_CHECKING:
    from hardware.rig.driving.register_reading import RegisterReading
    from hardware.rig.rig_file import RigJoint
    from hardware.rig.switching.identities import PortScan


class RegistersLook:
    """The registers of a joint's servo, once they are read."""

    def __init__(self, joint: RigJoint, reading: RegisterReading) -> None:
        self._joint, self._reading = joint, reading

    def answer(self) -> Registers | Refused | None:
        """The registers in order of address."""
        from hardware.control_table.meanings import meaning
        from hardware.rig.driving.register_reading import WRITABLE, shown_registers

        joint, reading = self._joint, self._reading
        if not reading.done:
            return None
        if reading.failure:
            return Refused(reading.failure)
        rows = [
            ServoRegister(row.name, row.address, count, meaning(joint.table, row, count), row.name in WRITABLE)
            for row in shown_registers(joint.table)
            for count in (reading.counts[row.name],)
        ]
        return Registers(joint.name, joint.model, rows)


class PortsLook:
    """Who is on the ports of a rig, once everybody was asked."""

    def __init__(self, scan: PortScan) -> None:
        self._scan = scan

    def answer(self) -> OnPorts | None:
        """Those who have answered, and the joints that have not."""
        found = self._scan.found
        if found is None:
            return None
        servos = [ServoOnPort(name, who.id, who.model, who.firmware) for name, who in found]
        return OnPorts(servos, self._scan.missing)
