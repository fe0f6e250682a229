"""The <visual> shapes of a URDF, which MuJoCo ignores: added to a model for drawing.

A custom text of the model names its URDF, also when saved. Physics, feet and limbs use its <collision> shapes only, and
never wait for large meshes.
"""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import msgspec
import mujoco
import numpy as np

from motiondeck_base.errors import MotiondeckError
from sim.models.formats.mesh_files import READABLE, SHELL, fill, read_meshes
from sim.models.formats.model_text import file_named, readable_urdf

MOVED_ORIGIN = "(moved origin)"  # a model's custom number: displacement of its root's origin, in its frame, m
_SOURCE = "(urdf)"
_SHOWN, _HIDDEN = 1, 3  # groups
_LARGEST = 40_000_000  # bytes of a mesh file


class _Source(msgspec.Struct, forbid_unknown_fields=True):
    file: str
    packages: dict[str, str]


def note_source(spec: mujoco.MjSpec, file: Path, packages: Mapping[str, Path]) -> None:
    """Notes a model's URDF and the folders of its packages in it."""
    source = _Source(str(file.resolve()), {name: str(folder.resolve()) for name, folder in packages.items()})
    spec.add_text(name=_SOURCE, data=msgspec.json.encode(source).decode())


def with_visuals(spec: mujoco.MjSpec) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """A model with the visual shapes of its URDF in place of the collision shapes of the same bodies, also editable."""
    # Bodies with unreadable or missing meshes keep their collision shapes, and so do all without a readable URDF.
    noted = next((text.data for text in spec.texts if text.name == _SOURCE), None)
    if noted is not None:
        source = msgspec.json.decode(noted, type=_Source)
        shown = spec.copy()
        with suppress(Exception):  # drawing never fails because of visual shapes
            _add_visuals(shown, Path(source.file), {name: Path(folder) for name, folder in source.packages.items()})
            return shown, shown.copy().compile()
    return spec, spec.compile()


def missing_visuals(file: Path, packages: Mapping[str, Path]) -> list[Path]:
    """The missing meshes of a URDF's visual shapes."""
    try:
        looks = mujoco.MjSpec.from_string(readable_urdf(file, packages, visuals=True))
    except (MotiondeckError, ValueError):  # reported elsewhere
        return []
    folder = file.resolve().parent / looks.meshdir
    files = [file_named(folder / mesh.file) for mesh in looks.meshes if mesh.file]
    return [file for file in files if not file.is_file()]


def _add_visuals(spec: mujoco.MjSpec, file: Path, packages: Mapping[str, Path]) -> None:
    looks = mujoco.MjSpec.from_string(readable_urdf(file, packages, visuals=True))
    folder = file.resolve().parent / looks.meshdir
    offsets = {text.name: np.array(text.data) for text in spec.numerics if text.name == MOVED_ORIGIN}
    root = next(body.name for body in spec.worldbody.bodies if body.joints)
    names = {body.name for body in spec.bodies}
    files = {mesh.name: file_named(folder / mesh.file) for mesh in looks.meshes}
    files = {
        name: file
        for name, file in files.items()
        if file.suffix.lower() in READABLE and file.is_file() and file.stat().st_size < _LARGEST
    }
    read = read_meshes(looks, files)
    meshes = {mesh.name: mesh for mesh in looks.meshes}
    done: set[str] = set()
    for body in looks.bodies[1:]:
        shapes = [geom for geom in body.geoms if geom.group == _SHOWN and not geom.contype]
        named = {geom.meshname for geom in shapes if geom.meshname}
        if not shapes or body.name not in names or not named <= files.keys():
            continue
        own = spec.body(body.name)
        for geom in own.geoms:
            geom.group = _HIDDEN
        offset = offsets.get(MOVED_ORIGIN, np.zeros(3)) if body.name == root else np.zeros(3)
        for name in named - done:
            mesh = spec.add_mesh(name=f"look {name}", scale=meshes[name].scale, inertia=SHELL)
            if name in read:
                fill(mesh, read[name])
            else:
                mesh.file = str(files[name])
        done |= named
        for geom in shapes:
            look = own.add_geom(type=geom.type, size=geom.size, quat=geom.quat, rgba=geom.rgba, group=_SHOWN, mass=0.0)
            look.pos, look.contype, look.conaffinity = np.array(geom.pos) - offset, 0, 0
            look.meshname = f"look {geom.meshname}" if geom.meshname else ""
