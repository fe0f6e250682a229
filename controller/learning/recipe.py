"""A training recipe: the recordings of each motion, and the network that learns them."""

import re
import unicodedata
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Union

import msgspec
import numpy as np

from controller.learning.preparation.takes import by_motion, motion_of
from controller.learning.trainers.centralized import CentralizedRecipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.trainers.trainer import NetworkRecipe, network_recipes, trainer_of
from controller.library.motion_library import with_ways
from controller.motion.clip import Up
from controller.motion.formats.reading import read_clip
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.files import way_from
from motiondeck_base.toml_file import read_toml, shaped, toml_value

if not TYPE_CHECKING:  # msgspec reads one of these
    NetworkRecipe = Union[network_recipes()]  # noqa: UP007

_SATELLITES = 6.0  # per second of the longest clip

MOST_LETTERS = 40  # of a name
NAME = re.compile(rf"[A-Za-z0-9][A-Za-z0-9_-]{{0,{MOST_LETTERS - 1}}}")
"""Names that can be typed at a prompt and in a script."""

_SPELLED = str.maketrans({"ß": "ss", "æ": "ae", "ø": "o", "œ": "oe", "ł": "l", "đ": "d", "ı": "i"})


class MotionRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """One motion."""

    file: str  # the recording, relative to the data folder
    name: str = ""  # of the motion; by default its file's
    # "loop" is closed and goes on for ever, "once" ends in a pose and holds it.
    plays: Literal["loop", "once"] = "loop"
    frames: tuple[int, int] | None = None  # first frame and the one after the last, or the whole recording
    # For an .amc, its .asf, relative to the data folder; without it the one nearby is taken.
    skeleton: str | None = None
    unit: float | None = None  # this and the next five override the file, as in `ReadingOptions`
    up: Up | None = None
    rename: dict[str, str] = msgspec.field(default_factory=dict[str, str])
    person: str | None = None
    rate: float | Literal["auto", "none"] | None = None  # `frames` count at this one
    ground: float | Literal["auto", "none"] | None = None
    upper_body: bool = False  # what was recorded without legs gets some that rest
    mirrored: bool = False  # whether left and right are exchanged
    # Further recordings of the same motion. Clips taught to a rig are joined with the first; with an input, they are
    # other values of it.
    takes: tuple[str, ...] = ()
    input: str = ""  # the name of an input besides the phase, in which the recordings differ, such as "speed"
    # Of the input in the recording and in each take; without them, those of "speed" are measured, m/s.
    values: tuple[float, ...] = ()
    # The person in the recording and in each take; the motion is then learned in the manner of the first, and the
    # others show the effect of the input. Without it all recordings count as one person's.
    people: tuple[str, ...] = ()


class LibraryRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """A motion library to be trained."""

    motions: list[MotionRecipe]
    name: str = ""  # of the library; without it, as the recipe's file
    # Its kind and parameters; by default phase-driven conceptors, which learn motions without tuning.
    network: NetworkRecipe = msgspec.field(default_factory=PhaseRecipe)
    # The recording whose own skeleton all motions are carried to; without it, the canonical body of the actor nearest
    # to those of all recordings.
    body: str = ""
    # Frames per second that recordings are brought to, Hz; without it that of the recordings, or 120 Hz if several.
    rate: float | None = None
    # Of the channels; joint rotations keep the twist of bones.
    encoding: Literal["bone directions", "joint rotations"] = "bone directions"
    # Learn the recordings as they are, each on its own body, no loop closed and no end held; the first frames, as many
    # as the washout, only lead in. This is what the thesis does.
    as_recorded: bool = False
    loop_keeps: float = 0.6  # the least share of a recording that its loop keeps
    # Tried in turn until every motion passes the self-test.
    seeds: list[int] = msgspec.field(default_factory=lambda: [0, 1, 2, 3, 4])
    licence: str = "unknown"  # of the recordings, as the next; both go into the library
    acknowledgement: str = ""


def read_recipe(path: Path, data: Path | None = None) -> LibraryRecipe:
    """The recipe in a TOML file, whose recordings have to be in the folder `data`, if it is given.

    FileFormatError has a line for each problem that names the file, the key and what is allowed.
    """
    recipe = read_toml(path, LibraryRecipe)
    motions = [m if m.name else msgspec.structs.replace(m, name=typeable(Path(m.file).stem)) for m in recipe.motions]
    return check_recipe(msgspec.structs.replace(recipe, name=recipe.name or path.stem, motions=motions), path, data)


def typeable(text: str) -> str:
    """The name nearest to a text that can be typed at a prompt and in a script; letters lose their accents."""
    text = unicodedata.normalize("NFKD", text.translate(_SPELLED))
    text = "".join(letter for letter in text if not unicodedata.combining(letter))
    return re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-_")[-MOST_LETTERS:].lstrip("-_") or "motion"


def warnings(recipe: LibraryRecipe) -> list[str]:
    """Omissions with which a recipe can still be trained."""
    if recipe.licence.strip().lower() not in ("", "unknown"):
        return []
    return ["no licence of the recordings is given, so the library may not be passed on: set licence in the recipe"]


def gesture_recipe(name: str, clips: Sequence[Path]) -> LibraryRecipe:
    """The recipe for a library of clips taught to a rig or written, each a motion or a take of one (`takes.by_motion`).

    A centralized network, because its state is a place on a closed curve: nothing can lead it away, and servos follow.
    Only the part of a loop is learned that comes back to its start best; with `loop_keeps` = 1 all of it, as where all
    loops are written so that they end in their first frame.
    FileFormatError if a name cannot be typed or is used twice, a clip cannot be read, or joints differ; it names them.
    """
    recorded = {path: read_clip(path) for path in clips}
    motions = [
        MotionRecipe(
            name=motion_of(one), file=str(one), plays=recorded[one].plays or "loop", takes=tuple(map(str, more))
        )
        for one, *more in by_motion(clips)
    ]
    expected = recorded[clips[0]].skeleton.bones
    for path, clip in recorded.items():
        lacking = [name for name in expected if name not in clip.skeleton.bones]
        besides = [name for name in clip.skeleton.bones if name not in expected]
        if lacking or besides:
            parts = (("lacks", lacking), ("has also", besides))
            differences = [f"{verb} {', '.join(joints)}" for verb, joints in parts if joints]
            raise FileFormatError(
                f"{path}: beside {clips[0]} it {' and '.join(differences)}; the clips of one library need the same "
                "joints. Teach them anew with one rig file, name all under `rest`, or make a library of each."
            )
    longest = max(clip.duration for clip in recorded.values())
    loops = [clip.rotation for clip in recorded.values() if clip.plays == "loop"]
    closed = bool(loops) and all(np.allclose(rotation[0], rotation[-1], atol=1e-9) for rotation in loops)
    recipe = LibraryRecipe(
        name=name,
        network=CentralizedRecipe(satellites=max(60, round(_SATELLITES * longest))),
        motions=motions,
        body=str(clips[0]),
        loop_keeps=1.0 if closed else 0.6,
        licence="Taught by hand: yours.",
    )
    return check_recipe(recipe, clips[0].parent)


def recipe_of(tree: object, path: Path) -> LibraryRecipe:
    """The recipe that a library was trained from, out of its header; FileFormatError if there is none in it."""
    return check_recipe(shaped(tree, LibraryRecipe, f"{path} (its recipe)"), path)


def check_name(name: str, path: Path) -> None:
    """Refuses, by FileFormatError, a name that cannot be typed at a prompt or in a script."""
    if not NAME.fullmatch(name):
        raise FileFormatError(f"{path}: motion '{name}' cannot be typed; use letters, digits, - and _ (at most 40)")


def check_recipe(recipe: LibraryRecipe, path: Path, data: Path | None = None) -> LibraryRecipe:
    """The recipe itself, if its names and numbers make sense, and its files are in the data folder, if one is given.

    Else FileFormatError has a line for each problem, with the path and what is allowed.
    """
    problems = [*_problems(recipe), *([] if data is None else _missing_files(recipe, data))]
    if problems:
        raise FileFormatError.listing(str(path), problems)
    return recipe


def require_sizes(network: NetworkRecipe) -> None:
    """Refuses, by MotiondeckError, sizes and scales that no network can have."""
    if type(network) not in network_recipes():  # what pyright sees, a user's script does not
        raise MotiondeckError(f"a recipe such as ConceptorRecipe() is needed, not {network!r}")
    for problem in _size_problems(network):
        raise MotiondeckError(problem)


def find_recording(data: Path, file: str) -> Path:
    """A recording below the data folder, or directly in it; FileFormatError if it is in neither."""
    for path in (data / file, data / Path(file).name):
        if path.exists():
            return path
    raise FileFormatError(f"{data / file}: there is no such file; --data is the folder that holds the recordings")


def _missing_files(recipe: LibraryRecipe, data: Path) -> Iterator[str]:
    files = [file for motion in recipe.motions for file in (motion.file, motion.skeleton, *motion.takes)]
    for file in dict.fromkeys([*files, recipe.body]):
        try:
            if file:
                find_recording(data, file)
        except FileFormatError as error:
            yield str(error)


def _problems(recipe: LibraryRecipe) -> Iterator[str]:
    names = [motion.name for motion in recipe.motions]
    if not names:
        yield "there are no [[motions]] in it"
    for name in sorted({name for name in names if names.count(name) > 1}):
        yield f"two motions are called '{name}'"
    for name in dict.fromkeys(names):
        if not NAME.fullmatch(name):
            yield f"motion '{name}' cannot be typed; use letters, digits, - and _ (at most 40)"
    for motion in recipe.motions:
        first, end = motion.frames or (0, 1)
        if not 0 <= first < end:
            yield f"motion '{motion.name}': frames is [{first}, {end}]; give the first one and the one after the last"
        yield from _input_problems(motion, recipe)
    if not recipe.seeds or min(recipe.seeds) < 0:
        yield f"seeds is {recipe.seeds}; give at least one whole number, none below 0"
    if not 0.1 <= recipe.loop_keeps <= 1.0:
        yield f"loop_keeps is {recipe.loop_keeps}; it lies between 0.1 and 1"
    if recipe.rate is not None and not 10.0 <= recipe.rate <= 1000.0:
        yield f"rate is {recipe.rate}; it lies between 10 and 1000 Hz"
    yield from _size_problems(recipe.network)
    trainer = trainer_of(recipe.network)
    if trainer.center_driven and recipe.as_recorded:
        yield "as_recorded is for networks that run by themselves; centers need closed loops and ends that hold"
    yield from trainer.problems(recipe.network, names)


def _input_problems(motion: MotionRecipe, recipe: LibraryRecipe) -> Iterator[str]:
    if not motion.input:
        for key in ("values", "people"):
            if getattr(motion, key):
                yield f"motion '{motion.name}' has {key}, but no input"
        return
    if not NAME.fullmatch(motion.input):
        yield f"input '{motion.input}' cannot be typed; use letters, digits, - and _ (at most 40)"
    if not trainer_of(recipe.network).takes_inputs:
        yield f"motion '{motion.name}' has an input, which only phase-driven networks can have"
    if motion.plays != "loop" or not motion.takes:
        yield f"motion '{motion.name}' has an input; it has to be a loop with takes, which are its other values"
    many = 1 + len(motion.takes)
    if not motion.values and motion.input != "speed":
        yield f"give the values of '{motion.input}' in the {many} recordings of motion '{motion.name}'"
    different = 2 if motion.people else many  # people may be recorded at the same value
    if motion.values and not (len(motion.values) == many and len(set(motion.values)) >= different):
        yield f"motion '{motion.name}' has {many} recordings, which need as many values, {different} of them different"
    if motion.people and len(motion.people) != many:
        yield f"motion '{motion.name}' has {many} recordings; give as many people, the first that it is to be like"


def _size_problems(network: NetworkRecipe) -> Iterator[str]:
    """Values of another type than the recipe's, which only a script can give, and sizes and scales out of range."""
    try:
        msgspec.convert(msgspec.to_builtins(network), type(network))
    except msgspec.ValidationError as error:
        yield f"{type(network).__name__}: {error}"
        return
    for field in network.__struct_fields__:
        value = getattr(network, field)
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        least = 0 if field.endswith(("noise", "wrong_starts")) else 1 if isinstance(value, int) else 1e-9
        most = 20_000 if field in {"neurons", "features"} else 1.0 if field == "leak" else 1e6
        if not least <= value <= most:
            yield f"network.{field} is {value}; it lies between {least} and {most}"


def recipe_text(recipe: LibraryRecipe, folder: Path | None = None) -> str:
    """The TOML text of a recipe, without fields at their defaults except for the network.

    Recordings and skeletons are named relative to its folder, if it is given, so that all can be moved together.
    """
    tree = msgspec.to_builtins(recipe)
    if folder is not None:
        tree = with_ways(tree, partial(way_from, folder))
    network, motions = tree.pop("network"), tree.pop("motions")
    defaults = {field.name: field.default for field in msgspec.structs.fields(LibraryRecipe) if not field.required}
    set_fields = {key: value for key, value in tree.items() if value is not None and value != defaults.get(key)}
    lines = [_toml_line(key, value) for key, value in set_fields.items()]
    if "licence" not in set_fields:
        lines.append(f"{_toml_line('licence', recipe.licence)}  # on what terms may the recordings be passed on?")
    lines += ["", "[network]", *(_toml_line(key, value) for key, value in network.items() if value is not None)]
    for motion in motions:
        given = {key: value for key, value in motion.items() if value not in (None, False, {}, (), [])}
        lines += ["", "[[motions]]", *(_toml_line(key, value) for key, value in given.items())]
    return "\n".join(lines) + "\n"


def _toml_line(key: str, value: Any) -> str:
    return f"{key} = {toml_value(value)}"
