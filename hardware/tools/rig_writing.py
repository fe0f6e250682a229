"""Writing rig files: from the servos that answer on a port, whole or not at all, and single values in place."""

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import msgspec

from hardware.errors import RigError
from hardware.families.models import MODELS, WHY_NO_JOINT
from hardware.rig.rig_file import RigConfig, load_rig
from hardware.rig.rig_joint import RigJoint
from hardware.tools.scan import Found
from motiondeck_base.files import write_file
from motiondeck_base.toml_file import toml_value

FIRST_VELOCITY = 2.0  # rad/s: what a joint may do until somebody knows better; every model can
_RATE = 100.0  # Hz
_PORT_LINE = re.compile(r"^port\s*=.*$", re.MULTILINE)
_NO_SYNTAX = re.compile(r'"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*')  # text in which no key stands
_JOINT = re.compile(r"\{[^{}]*\}|^[ \t]*\[\[\s*joints\s*\]\].*?(?=^[ \t]*\[|\Z)", re.MULTILINE | re.DOTALL)


def new_joint(name: str, id: int, model: str) -> RigJoint:
    """A joint of which only the servo is known: angle 0 is in the middle of its one turn, and all of it is allowed."""
    if model in WHY_NO_JOINT:
        raise RigError(f"id {id}: model {model} cannot be a joint: {WHY_NO_JOINT[model]}.")
    if model not in MODELS:
        raise RigError(f"id {id}: Motiondeck does not know its model ({model}).")
    table = MODELS[model]
    bottom, top = table.one_turn
    zero = (bottom + top + 1) // 2
    half = min(zero - bottom, top - zero) / table.pulses_per_turn * 6.28
    try:
        return RigJoint(name, id, model, 1, zero, round(-half, 2), round(half, 2), FIRST_VELOCITY)
    except ValueError as error:
        raise RigError(f"id {id}: {error}.") from error


def rig_of(found: Sequence[Found], port: str) -> tuple[RigConfig, list[str]]:
    """A rig of the servos that answered a scan, named joint_ID; and those that cannot be joints of it, and why.

    RigError if no servo can, or they cannot share one port as they are; it says what to do.
    """
    if not found:
        raise RigError(f"no servo answers on {port}. Check power, cable and adapter.")
    joints: list[RigJoint] = []
    bauds: list[int] = []
    left_out: list[str] = []
    for baud, servo in sorted(found, key=lambda one: one.identity.id):
        try:
            joints.append(new_joint(f"joint_{servo.id}", servo.id, servo.model))
        except RigError as error:
            left_out.append(str(error))
        else:
            bauds.append(baud)
    if not joints:
        raise RigError("\n".join(["no servo can be a joint of a rig.", *left_out]))
    return assembled(joints, port, bauds), left_out


def assembled(joints: Iterable[RigJoint], port: str, bauds: Iterable[int]) -> RigConfig:
    """The rig of some joints on one port, which answer at these baud rates; RigError if they cannot share it."""
    first, *others = sorted(set(bauds))
    if others:
        rates = " and ".join(map(str, (first, *others)))
        raise RigError(f"servos answer at {rates} baud. Bring each to one of them: motiondeck rig setup")
    try:
        return RigConfig(port, first, _RATE, tuple(joints))
    except ValueError as error:
        raise RigError(f"{error}.") from error


def save_rig(config: RigConfig, path: Path) -> None:
    """Writes a rig file."""
    settings = msgspec.structs.asdict(config)
    lines = [f"{key} = {toml_value(value)}" for key, value in settings.items() if key != "joints"]
    lines += ["", "# zero in pulses, lower and upper in rad, velocity in rad/s", "joints = ["]
    usual = {field.name: field.default for field in msgspec.structs.fields(RigJoint) if not field.required}
    for joint in config.joints:
        own = {key: value for key, value in msgspec.structs.asdict(joint).items() if value != usual.get(key)}
        row = ", ".join(f"{key} = {toml_value(value)}" for key, value in own.items())
        lines.append(f"  {{ {row} }},")
    write_file(path, "\n".join([*lines, "]", ""]).encode())


def set_port(path: Path, port: str) -> str:
    """Writes another port into a rig file, and keeps all else, comments too; the port before. RigError if several."""
    config = load_rig(path)
    if config.ports != (config.port,):
        raise RigError(f"{path} has the ports {', '.join(config.ports)}: write {port} where it belongs.")
    line = f"port = {toml_value(port)}"
    write_file(path, _PORT_LINE.sub(lambda _: line, path.read_text(encoding="utf-8"), count=1).encode())
    return config.port


def set_in_joints(path: Path, values: Mapping[str, Mapping[str, float]], out: Path) -> Path | None:
    """Writes a rig file with these values of joints, by name and key, and leaves all else as it is, comments too.

    Returns where the file is kept that stood at `out` before, if any. RigError if the file is written so unusually that
    the values cannot be put into it; nothing is written then.
    """
    config, text = load_rig(path), path.read_text(encoding="utf-8")
    joints = [msgspec.structs.replace(joint, **values.get(joint.name, {})) for joint in config.joints]
    wanted = msgspec.structs.replace(config, joints=tuple(joints))
    for number, joint in enumerate(config.joints):
        for key, value in values.get(joint.name, {}).items():
            text = _with_value(text, number, key, value)
    try:
        same = msgspec.convert(tomllib.loads(text), RigConfig) == wanted
    except (tomllib.TOMLDecodeError, msgspec.ValidationError):
        same = False
    if not same:
        raise RigError(f"{path} is written in a way that values cannot be put into. Put them in by hand.")
    kept = out.with_name(f"{out.name}.bak") if out.exists() else None
    if kept is not None:
        write_file(kept, out.read_bytes())
    write_file(out, text.encode())
    return kept


def _with_value(text: str, joint: int, key: str, value: float) -> str:
    """The text of a rig file with this value in the row of its joint with this number, from 0."""
    rows = list(_JOINT.finditer(_NO_SYNTAX.sub(lambda found: "_" * len(found[0]), text)))
    if joint >= len(rows):
        return text
    start, row = rows[joint].start(), rows[joint][0]
    if given := re.search(rf"(?<![\w-]){key}\s*=\s*([-+.\w]+)", row):
        before, after, put = start + given.start(1), start + given.end(1), f"{value:g}"
    elif row.startswith("{"):
        before = after = start + len(row.rstrip("} \t\n"))
        put = f", {key} = {value:g}"
    else:
        before = after = start + row.index("\n")
        put = f"\n{key} = {value:g}"
    return text[:before] + put + text[after:]
