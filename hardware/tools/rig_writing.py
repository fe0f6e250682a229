"""Writing rig files: from the servos that answer on a port, whole or not at all, and the port alone in place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from hardware.control_table.models import MODELS
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig, RigJoint, load_rig
from hardware.tools.scan import Found

FIRST_VELOCITY = 2.0  # rad/s: what a joint may do until somebody knows better; every model can
_RATE = 100.0  # Hz
_PORT_LINE = re.compile(r"^port\s*=.*$", re.MULTILINE)


def new_joint(name: str, id: int, model: str) -> RigJoint:
    """A joint of which only the servo is known: angle 0 is in the middle of its one turn, and all of it is allowed.

    Raises:
        RigError: if the model cannot be a joint of a rig.
    """
    if model not in MODELS:
        raise RigError(f"id {id} is a {model}, which Motiondeck does not know.")
    table = MODELS[model]
    bottom, top = table.one_turn
    zero = (bottom + top + 1) // 2
    half = min(zero - bottom, top - zero) / table.pulses_per_turn * 6.28
    try:
        return RigJoint(name, id, model, 1, zero, round(-half, 2), round(half, 2), FIRST_VELOCITY)
    except ValueError as error:
        raise RigError(f"id {id}: {error}.") from error


def rig_of(found: Sequence[Found], port: str) -> RigConfig:
    """A rig of the servos that answered a scan, named joint_ID.

    Raises:
        RigError: if there are none, or they cannot share one port as they are; it says what to do.
    """
    if not found:
        raise RigError(f"no servo answers on {port}. Check power, cable and adapter.")
    bauds = sorted({one.baud for one in found})
    if len(bauds) > 1:
        raise RigError(
            f"servos answer at {' and '.join(map(str, bauds))} baud. Bring each to one of them: motiondeck rig setup"
        )
    servos = sorted((one.identity for one in found), key=lambda identity: identity.id)
    return assembled((new_joint(f"joint_{one.id}", one.id, one.model) for one in servos), port, bauds[0])


def assembled(joints: Iterable[RigJoint], port: str, baud: int) -> RigConfig:
    """The rig of some joints on one port.

    Raises:
        RigError: if they cannot share it.
    """
    try:
        return RigConfig(port, baud, _RATE, tuple(joints))
    except ValueError as error:
        raise RigError(f"{error}.") from error


def save_rig(config: RigConfig, path: Path) -> None:
    """Writes a rig file, whole or not at all.

    Raises:
        RigError: if it cannot be written.
    """
    settings = msgspec.structs.asdict(config)
    lines = [f"{key} = {_toml(value)}" for key, value in settings.items() if key != "joints"]
    lines += ["", "# zero in pulses, lower and upper in rad, velocity in rad/s", "joints = ["]
    usual = {field.name: field.default for field in msgspec.structs.fields(RigJoint) if not field.required}
    for joint in config.joints:
        own = {key: value for key, value in msgspec.structs.asdict(joint).items() if value != usual.get(key)}
        row = ", ".join(f"{key} = {_toml(value)}" for key, value in own.items())
        lines.append(f"  {{ {row} }},")
    _replace(path, "\n".join([*lines, "]", ""]))


def set_port(path: Path, port: str) -> str:
    """Writes another port into a rig file, and leaves all else in it as it is, comments too.

    Returns:
        The port that stood there before.

    Raises:
        RigFileError: if it is not a rig file.
        RigError: if it has several ports, or cannot be written.
    """
    config = load_rig(path)
    if config.ports != (config.port,):
        raise RigError(f"{path} has the ports {', '.join(config.ports)}: write {port} where it belongs.")
    line = f"port = {_toml(port)}"
    _replace(path, _PORT_LINE.sub(lambda _: line, path.read_text(encoding="utf-8"), count=1))
    return config.port


def _replace(path: Path, text: str) -> None:
    """Puts a text in the place of a file, whole or not at all."""
    draft = path.with_name(f".{path.name}.draft")
    try:
        draft.write_text(text, encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        raise RigError(f"cannot write the rig file {path}: {error.strerror}.") from error


def _toml(value: object) -> str:
    return msgspec.json.encode(value).decode() if isinstance(value, str) else str(value)
