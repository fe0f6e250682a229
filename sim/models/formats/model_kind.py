"""What kind of file a robot's model is, before MuJoCo reads it: its own errors name no remedy."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from xml.parsers import expat

from motiondeck_base.errors import FileFormatError
from sim.models.formats.xml_text import UTF16, xml_text

ROOTS = ("mujoco", "robot")
MODEL = "a robot's model is an MJCF (.xml) or a URDF (.urdf)"
_SHOWN = 5


def model_kind(path: Path) -> str:
    """What the file of a robot's model is: "mujoco" for an MJCF, "robot" for a URDF, whatever its name.

    Raises:
        FileFormatError: if there is none, or it is of another kind; it says what was expected.
    """
    if path.is_dir():
        inside = sorted(file.name for file in path.iterdir() if file.suffix.lower() in (".xml", ".urdf"))
        names = f"; in it are {', '.join(inside[:_SHOWN])}" if inside else ""
        raise FileFormatError(f"{path}: a folder; {MODEL}{names}")
    if not path.is_file():
        raise FileFormatError(f"{path}: there is no such model file; {MODEL}")
    if path.suffix.lower() == ".toml":
        raise FileFormatError(f"{path}: a TOML file; {MODEL}. A robot file names its own under `model`")
    tags = _tags_of(path)
    root = tags[0] if tags else ""
    if not root:
        raise FileFormatError(f"{path}: not XML; {MODEL}")
    if root not in ROOTS:
        raise FileFormatError(f"{path}: an XML file of another kind (<{root}>); {MODEL}")
    if any(tag.startswith("xacro:") for tag in tags):
        raise FileFormatError(f"{path}: a URDF with xacro macros; write them out first: xacro {path.name} > robot.urdf")
    if root == "mujoco" and path.read_bytes().startswith(UTF16):
        raise FileFormatError(f"{path}: its text is UTF-16, which MuJoCo does not read; save it as UTF-8")
    return root


def _tags_of(path: Path) -> list[str]:
    """The names of the elements of an XML file, in its order, as far as it can be read."""
    found: list[str] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda tag, _: found.append(tag)
    with suppress(expat.ExpatError):  # what is wrong further on, MuJoCo says
        parser.Parse(xml_text(path), True)
    return found
