"""Set-up of a bag of new servos, one after another, with the IDs and the baud rate of a rig file."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from hardware.bus.servo_bus import Bus
from hardware.errors import RigError, ServoError
from hardware.rig.rig_file import load_rig
from hardware.rig.rig_joint import RigJoint
from hardware.tools.scan import Found, set_up
from motiondeck_base.files import write_file


def set_up_all(
    rig: Path, open_bus: Callable[[int], Bus], ask: Callable[[str], object], say: Callable[[str], object]
) -> None:
    """Sets up every servo of a rig file in turn; `ask` waits until the next one is connected alone.

    Which ones are done is kept in a file beside the rig file, from which the next run goes on. A servo that cannot be
    set up is asked for again, with the reason. MotiondeckError if the rig file or that file cannot be read or written.
    """
    config, kept = load_rig(rig), rig.with_name(f"{rig.name}.setup")
    servos = config.servos.joints
    known = [joint.name for joint in servos]
    done = [name for name in kept.read_text().splitlines() if name in known] if kept.exists() else []
    for joint in servos:
        while joint.name not in done:
            ask(f"{joint.label}: connect a new {joint.model} alone, and press Enter ")
            earlier = {servo.id: servo.name for servo in servos if servo.name in done}
            try:
                check = partial(_check, joint, config.baud, earlier)
                before, _ = set_up(open_bus, joint.id, config.baud, check)
            except (RigError, ServoError) as error:
                say(f"{error}")
                continue
            done.append(joint.name)
            write_file(kept, "".join(f"{name}\n" for name in done).encode())
            was = f"id {before.identity.id} at {before.baud} baud"
            say(f"{joint.name}: {was} is now id {joint.id} at {config.baud} baud ({len(done)} of {len(servos)})")
    kept.unlink(missing_ok=True)


def _check(joint: RigJoint, baud: int, earlier: dict[int, str], found: Found) -> None:
    """Refuses a servo of another model, or one that was set up before, by RigError."""
    if found.identity.model != joint.model:
        raise RigError(f"a {found.identity.model} answers, but {joint.label} is a {joint.model}. Connect that.")
    table = joint.table
    new = found.identity.id == 1 and table.baud_value(found.baud) == table["baud_rate"].default
    if found.baud == baud and found.identity.id in earlier and not new:
        raise RigError(f"this is the servo of {earlier[found.identity.id]}, set up before. Connect the next one.")
