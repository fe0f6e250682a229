"""Whether the servos of a rig are there, are those of the rig file, answer, and are well."""

from collections.abc import Sequence

from hardware.bus.servo_bus import UNKNOWN_MODEL, Bus, Identity
from hardware.errors import LostServosError, RigError, ServoError
from hardware.families.models import TRAITS
from hardware.families.table import describe_errors
from hardware.rig.registers import list_joints, read_each, read_register, sync_write_all
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint

MUTE = "{} answers a ping but no read: its status_return_level is 0. Set it with motiondeck rig doctor RIG --fix."


def check_identities(config: RigConfig, bus: Bus) -> None:
    """Pings every servo of the rig file, and names all that are missing or of another model in one error."""
    found: dict[int, Identity | None] = {}
    garbled: list[RigJoint] = []
    for joint in config.joints:
        found[joint.id] = bus.ping(joint.id)
        if found[joint.id] is None and bus.garbled:
            garbled.append(joint)
    if garbled:
        raise RigError(
            f"garbled answers from {list_joints(garbled)} on {bus.port.name}: two servos may have the same id. "
            "motiondeck rig doctor names those that are missing."
        )
    missing = [joint for joint in config.joints if found[joint.id] is None]
    if missing:
        raise LostServosError(
            f"no answer on {bus.port.name} at {bus.baud} baud from {list_joints(missing)}. "
            "Check power, cables and ids; motiondeck rig doctor finds servos at other ids and baud rates.",
            {joint.joint_name for joint in missing},
            "does not answer",
        )
    mute = [joint for joint in config.joints if (one := found[joint.id]) and one.model_number == UNKNOWN_MODEL]
    if mute:
        raise RigError(MUTE.format(list_joints(mute)))
    others = [
        f"{joint.label} answers as {identity.model}, not as {joint.model}"
        for joint in config.joints
        if (identity := found[joint.id]) is not None and identity.model != joint.model
    ]
    if others:
        raise RigError(f"{'; '.join(others)}. Correct the model in the rig file.")


def raise_answer_level(config: RigConfig, bus: Bus) -> None:
    """Sets servos to answer every instruction: a mute one would look like one that is missing."""
    for index, joint in enumerate(config.joints):
        if joint.table["status_return_level"].memory == "RAM":
            _answer_all(config.only([index]), bus)


def raise_answer_level_in_eeprom(config: RigConfig, bus: Bus) -> None:
    """The same for servos with this level in EEPROM; where it is too low, the ping does not tell the model."""
    # EEPROM cells wear out, so it is written only where it is wrong.
    for index, joint in enumerate(config.joints):
        in_eeprom = joint.table["status_return_level"].memory == "EEPROM"
        if in_eeprom and answer_level(joint, bus) != joint.table.family.answers_all:
            sync_write_all(config.only([index]), bus, "torque_enable", 0)
            _answer_all(config.only([index]), bus)


def answer_level(joint: RigJoint, bus: Bus) -> int:
    """The status return level of a servo: 0, a ping, if it answers no read."""
    try:
        return read_register(joint, bus, "status_return_level")
    except ServoError:
        return 0


def _answer_all(config: RigConfig, bus: Bus) -> None:
    sync_write_all(config, bus, "status_return_level", config.joints[0].table.family.answers_all)


def know_fast_reads(config: RigConfig, firmware: Sequence[int]) -> bool:
    """Whether servos with these versions of firmware answer fast sync reads, but for families without any."""
    asked = [index for index, joint in enumerate(config.joints) if joint.table.family.fast_reads]
    since = [TRAITS[config.joints[index].model].fast_read for index in asked]
    return all(first is not None and firmware[index] >= first for index, first in zip(asked, since, strict=True))


def refuse_shut_down(config: RigConfig, bus: Bus) -> None:
    """Names the servos that a hardware problem has switched off."""
    down = {
        f"{joint.name} (id {joint.id}: {describe_errors(found)})": joint.joint_name
        for joint, mask in zip(config.joints, read_each(config, bus, "shutdown"), strict=True)
        if (found := hardware_errors(joint, bus)) & joint.table.series.usual_problems(mask)
    }
    if down:
        said = f"shut down: {'; '.join(down)}. Mend the cause, then switch the servo's power off and on."
        raise LostServosError(said, set(down.values()), "has shut down")


def hardware_errors(joint: RigJoint, bus: Bus) -> int:
    """The problems that a servo reports, in the bits of `describe_errors`."""
    # Without a register for it every reply has the error.
    error = joint.table.registers.get("hardware_error_status")
    register = error or joint.table["torque_enable"]
    status = bus.read(joint.id, register.address, register.length)
    return joint.table.series.usual_problems(error.decode(status.params)) if error else status.hardware


class PortScan:
    """The servos that answer on the ports of a rig that is switched on, and the joints that do not.

    Every ID is asked at the rig's own baud rate: another would take the port away from the servos. Families that have
    to be asked ID by ID are looked for where the rig has some: that takes five seconds.
    """

    def __init__(self, config: RigConfig, ports: int) -> None:
        self._config, self._ports = config, ports
        self._found: list[list[tuple[str, Identity]]] = []

    def ask(self, part: RigConfig, bus: Bus) -> None:
        """Asks on one port; waits for the answers."""
        identities = bus.ping_all()
        if not all(family.identification.by_ping for family in part.families.values()):
            identities += bus.ping_each()
        names = {(joint.id, joint.table.family): joint.name for joint in part.joints}
        self._found.append([(names.get((one.id, one.family), ""), one) for one in identities])

    @property
    def found(self) -> list[tuple[str, Identity]] | None:
        """Name of the joint ("" for a servo that is not in the rig file) and identity; None until all are asked."""
        return [one for port in self._found for one in port] if len(self._found) == self._ports else None

    @property
    def missing(self) -> list[str]:
        """Joints whose servo has not answered."""
        answered = {name for name, _ in self.found or ()}
        return [name for name in self._config.names if name not in answered]
