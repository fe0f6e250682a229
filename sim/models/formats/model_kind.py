"""The XML of a model file: its text, and whether it is an MJCF or a URDF. MuJoCo's own errors name no remedy."""

from __future__ import annotations

import codecs
import re
from contextlib import suppress
from pathlib import Path
from xml.parsers import expat

from motiondeck_base.errors import FileFormatError

_DECLARATION = re.compile(r"<\?xml\b[^>]*\?>")
_ENCODING = re.compile(rb"""<\?xml\b[^>]*\bencoding\s*=\s*["']([\w.-]+)["']""")
UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
ROOTS = ("mujoco", "robot")
MODEL = "a robot's model is an MJCF (.xml) or a URDF (.urdf)"
_SHOWN = 5


def xml_text(path: Path) -> str:
    """The text of a file without its XML declaration; FileFormatError if it cannot be read.

    The encoding is that of its first bytes or declaration, else UTF-8 or Latin-1.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileFormatError(f"{path}: it cannot be read ({error})") from None
    said = _ENCODING.search(content)
    encoding = "utf-16" if content.startswith(UTF16) else said[1].decode() if said else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except (UnicodeDecodeError, LookupError):
        text = content.decode("latin-1")
    return _DECLARATION.sub("", text, count=1).strip().lstrip("\ufeff")


def model_kind(path: Path) -> str:
    """The kind of a model file: "mujoco" for an MJCF, "robot" for a URDF, whatever its name.

    Raises:
        FileFormatError: if it is missing or of another kind; it names what was expected.
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
    """The names of the elements of an XML file, in order, as far as it can be read."""
    found: list[str] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda tag, _: found.append(tag)
    with suppress(expat.ExpatError):  # MuJoCo reports later errors
        parser.Parse(xml_text(path), True)
    return found
