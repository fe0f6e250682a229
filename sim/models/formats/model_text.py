"""The text of model files: whether one is an MJCF or a URDF, and URDFs of other tools, rewritten for MuJoCo.

Such URDFs name meshes by package://, Gazebo's model:// or from the folder of the file, have commas between numbers, and
no <collision> shapes. MuJoCo ignores their speed limits, and its own errors name no remedy.
"""

import codecs
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from xml.dom import expatbuilder
from xml.parsers import expat

from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import as_float

_DECLARATION = re.compile(r"<\?xml\b[^>]*\?>")
_ENCODING = re.compile(rb"""<\?xml\b[^>]*\bencoding\s*=\s*["']([\w.-]+)["']""")
UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
ROOTS = ("mujoco", "robot")
MODEL = "a robot's model is an MJCF (.xml) or a URDF (.urdf)"
_SHOWN = 5
# Largest plausible speed, rad/s: a file with more, such as 100 for all joints, has placeholders.
FASTEST = 50.0
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_NUMBERS = re.compile(r"""\b(xyz|rpy)\s*=\s*(["'])([^"']*,[^"']*)\2""")
_NO_NUMBER = re.compile(r"""\b(?:lower|upper|effort|velocity)\s*=\s*["']\s*[+-]?nan\s*["']""", re.IGNORECASE)
_URI = re.compile(r'(?:package|model):/{2,3}([^/"\']+)/([^"\']*)')
_LOOK = re.compile(r"<visual\b.*?</visual\s*>", re.DOTALL)
_FILE = re.compile(r"""(<mesh\b[^>]*\bfilename\s*=\s*["'])(?:file://)?([^"':]+)(?=["'])""")


def xml_text(path: Path) -> str:
    """The text of a file without its XML declaration; FileFormatError if it cannot be read."""
    # The encoding is that of its first bytes or declaration, else UTF-8 or Latin-1.
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
    """The kind of a model file, whatever its name: "mujoco" or "robot" (URDF); FileFormatError if neither."""
    if path.is_dir():
        inside = sorted(file.name for file in path.iterdir() if file.suffix.lower() in (".xml", ".urdf"))
        names = f"; in it are {', '.join(inside[:_SHOWN])}" if inside else ""
        raise FileFormatError(f"{path}: a folder; {MODEL}{names}")
    if not path.is_file():
        raise FileFormatError(f"{path}: there is no such model file; {MODEL}")
    if path.suffix.lower() == ".toml":
        raise FileFormatError(f"{path}: a TOML file; {MODEL}. A robot file names its own under `model`")
    tags: list[str] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda tag, _: tags.append(tag)
    with suppress(expat.ExpatError):  # MuJoCo reports later errors
        parser.Parse(xml_text(path), True)
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


def urdf_speeds(path: Path) -> dict[str, float]:
    """The plausible speed limits of a URDF's joints, rad/s; empty for another file. FileFormatError for a DOCTYPE."""
    text = _COMMENT.sub("", xml_text(path))
    if "<!DOCTYPE" in text:
        raise FileFormatError(f"{path}: it declares a document type (<!DOCTYPE ...>); take that out")
    try:
        model = expatbuilder.parseString(text, namespaces=False).documentElement
    except expat.ExpatError:
        return {}  # MuJoCo reports the error
    joints = model.getElementsByTagName("joint") if model is not None and model.tagName == "robot" else []
    limits = [(joint.getAttribute("name"), limit) for joint in joints for limit in joint.getElementsByTagName("limit")]
    speeds = {joint: as_float(limit.getAttribute("velocity")) or 0.0 for joint, limit in limits}
    return {joint: speed for joint, speed in speeds.items() if joint and 0.0 < speed <= FASTEST}


def readable_urdf(path: Path, packages: Mapping[str, Path], visuals: bool = False) -> str:
    """The text of a URDF for MuJoCo, with absolute paths of meshes.

    A package is a folder of its name, in `packages` or beside or above the file. <visual> shapes are kept with
    `visuals`, or if there are no others. FileFormatError if a package of <collision> shapes is missing, or the file
    cannot be read as text.
    """
    text = xml_text(path)

    def in_package(uri: re.Match[str]) -> str:
        name, inside = uri[1], uri[2]
        folders = [packages[name]] if name in packages else []
        for above in path.resolve().parents if not folders else ():
            folders += [above] if above.name == name else [above / name]
        files = (file_named(folder.resolve() / inside) for folder in folders)
        found = next((file for file in files if file.exists()), None)
        if found is None and any(start < uri.start() < end for start, end in looks):
            return (folders[0] / inside).as_posix()
        if found is None:
            where = f"in {packages[name]}" if name in packages else f"beside or above {path.resolve().parent}"
            raise FileFormatError(f"{path}: {uri[0]} is not {where}. Say where it is with --package {name}=FOLDER.")
        return found.resolve().as_posix()

    def in_folder(name: re.Match[str]) -> str:
        found = file_named(path.resolve().parent / name[2])
        return f"{name[1]}{found.as_posix()}" if found.is_file() else name[0]

    text = _NO_NUMBER.sub("", _COMMENT.sub("", text))  # MuJoCo would write a file of warnings
    text = _NUMBERS.sub(lambda numbers: f'{numbers[1]}="{numbers[3].replace(",", " ")}"', text)
    looks = [look.span() for look in _LOOK.finditer(text)] if has_collision_shapes(text) else []
    resolved = _FILE.sub(in_folder, _URI.sub(in_package, text))
    if resolved != text:
        # MuJoCo takes the folders off the meshes of a URDF, unless the file says otherwise.
        text = _with_setting(resolved, "strippath", "false")
    return _with_setting(text, "discardvisual", "false") if visuals or not has_collision_shapes(text) else text


def file_named(path: Path) -> Path:
    """The file of a path, also where the case of letters differs; the path itself if there is none, or several."""
    here = Path(path.anchor)
    for part in path.parts[1:]:
        if not (here / part).exists():
            alike = [one for one in here.iterdir() if one.name.lower() == part.lower()] if here.is_dir() else []
            if len(alike) != 1:
                return path
            part = alike[0].name
        here = here / part
    return here


def visual_packages(path: Path) -> list[str]:
    """The packages that a URDF names in its <visual> shapes."""
    text = _COMMENT.sub("", xml_text(path))
    named = (uri[1] for look in _LOOK.finditer(text) for uri in _URI.finditer(look[0]))
    return list(dict.fromkeys(named))


def has_collision_shapes(text: str) -> bool:
    """Whether a URDF has <collision> shapes outside comments."""
    return "<collision" in _COMMENT.sub("", text)


def _with_setting(text: str, name: str, value: str) -> str:
    text = re.sub(rf"""\b{name}\s*=\s*["'][^"']*["']""", "", text)
    if "<compiler" in text:
        return text.replace("<compiler", f'<compiler {name}="{value}"', 1)
    return re.sub(r"(<robot\b[^>]*>)", rf'\1<mujoco><compiler {name}="{value}"/></mujoco>', text, count=1)
