"""Who is on the ports of a rig that is switched on: its own servos, strangers, and those that are missing."""

from __future__ import annotations

from collections.abc import Sequence

from hardware.bus.servo_bus import Bus, Identity
from hardware.rig.rig_file import RigConfig


class PortScan:
    """A look at every ID of a port, at the rig's own baud rate: others would take the port away from the servos.

    Servos of Protocol 1.0 are looked for where the rig has some: 253 IDs one by one take five seconds.

    Attributes:
        found: who has answered, by the joint's name or "" for one that is not in the rig file, in order of ID; None
            while it is under way.
        missing: joints whose servo has not answered.
    """

    def __init__(self, config: RigConfig, parts: Sequence[PortScan] = ()) -> None:
        self._config, self._parts = config, parts
        self._found: list[tuple[str, Identity]] | None = None

    def ask(self, bus: Bus) -> None:
        """Asks; waits for the answers."""
        identities = bus.ping_all() + (bus.ping_old() if self._config.old_ids else [])
        names = {(joint.id, joint.table.protocol): joint.name for joint in self._config.joints}
        self._found = [(names.get((one.id, one.protocol), ""), one) for one in identities]

    @property
    def found(self) -> list[tuple[str, Identity]] | None:
        """See the class."""
        if not self._parts:
            return self._found
        parts = [part.found for part in self._parts]
        return None if None in parts else [one for part in parts if part is not None for one in part]

    @property
    def missing(self) -> list[str]:
        """See the class."""
        answered = {name for name, _ in self.found or ()}
        return [name for name in self._config.names if name not in answered]
