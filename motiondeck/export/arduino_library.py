"""Writes a figure as an Arduino library: the player, commands as lines of text, and sketches that drive servos."""

from pathlib import Path

from hardware.rig.rig_file import RigConfig
from motiondeck.export.c_folder import SOURCES, figure_header
from motiondeck.export.figure import Figure
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import write_file

SKETCHES = Path(__file__).with_name("arduino")
REGISTERS = {"SERVO_GOAL": "goal_position", "SERVO_PRESENT": "present_position", "SERVO_WATCHDOG": "bus_watchdog"}


def write_arduino(figure: Figure, rig: RigConfig, folder: Path) -> None:
    """Writes the library for the servos of a rig; MotiondeckError if they are not Dynamixel servos of one kind."""
    servos = [(joint, *one) for joint, row in enumerate(rig.joints) for one in enumerate(row.servos)]
    tables = {tuple(one.table.registers.get(name) for name in REGISTERS.values()) for _, _, one in servos}
    if len(tables) > 1 or None in (registers := tables.pop()):
        raise MotiondeckError("the sketch drives Dynamixel servos with a bus watchdog, whose registers are alike")
    defined = {name: register.address for name, register in zip(REGISTERS, registers, strict=True) if register}
    defined |= {"SERVOS": len(servos), "SERVO_BAUD": rig.baud, "SERVO_WATCHDOG": -(-rig.watchdog_ms // 20)}
    lines = [*(f"#define {name} {value}" for name, value in defined.items()), "static const md_servo servos[] = {"]
    for joint, second, one in servos:
        scale = f"{one.zero}, {one.pulses_per_radian:.5f}f"
        lines.append(f"{{{joint}, {second}, {one.id}, {one.mode}, {scale}}}, /* {one.name} */")
    files = {file.relative_to(SKETCHES): file.read_bytes() for file in SKETCHES.rglob("*.*") if file.is_file()}
    files |= {Path("src/figure.h"): figure_header(figure), Path("src/servos.h"): "\n".join([*lines, "};\n"]).encode()}
    most = b"#define MD_MOST_JOINTS %d" % len(figure.rest)
    for source in (one for one in SOURCES if one.stem in ("player", "envelope")):
        text = source.read_bytes().replace(b"#define MD_MOST_JOINTS 32", most).replace(b'envelope.c"', b'envelope.inc"')
        files[Path("src", source.name.replace(".c", ".inc"))] = text
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_file(folder / name, content)
