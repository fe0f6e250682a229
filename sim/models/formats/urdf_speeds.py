"""How fast the joints of a URDF may turn: its limits of velocity, which MuJoCo leaves out."""

from __future__ import annotations

from pathlib import Path
from xml.parsers import expat

from motiondeck_base.errors import FileFormatError
from sim.models.formats.xml_text import xml_text

# No servo turns a limb faster, rad/s: a file that says more, such as 100 for all joints, says nothing.
FASTEST = 50.0


def urdf_speeds(path: Path) -> dict[str, float]:
    """The speed limit of each joint of a URDF that has one that can be, rad/s; nothing for another file.

    Raises:
        FileFormatError: if the file declares a document type, whose entities could grow without end.
    """
    speeds: dict[str, float] = {}
    joint = ""
    is_urdf: bool | None = None

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal joint, is_urdf
        if is_urdf is None:
            is_urdf = tag == "robot"
        if tag == "joint":
            joint = attributes.get("name", "")
        elif tag == "limit" and joint and is_urdf:
            speed = _number(attributes.get("velocity", ""))
            if 0.0 < speed <= FASTEST:
                speeds[joint] = speed

    def end(tag: str) -> None:
        nonlocal joint
        if tag == "joint":
            joint = ""

    def doctype(*_: object) -> None:
        raise FileFormatError(f"{path}: it declares a document type (<!DOCTYPE ...>); take that out")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(xml_text(path), True)
    except expat.ExpatError:
        return {}  # what of it can be used, and what is wrong with it, MuJoCo says
    return speeds


def _number(words: str) -> float:
    try:
        return float(words)
    except ValueError:
        return 0.0
