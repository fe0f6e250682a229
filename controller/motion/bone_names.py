"""Body part and side of bones and joints, by their usual names.

One table serves CMU and HDM05, LAFAN1, SOMA, Mixamo, MotionBuilder, 3ds Max Biped, Rokoko, Xsens, SMPL, Bandai-Namco,
VRM, iClone, OpenSim and OpenPose: prefixes and separators are dropped, the side is taken from words such as "Left", "L"
or "lt", and the rest is looked up. A bone is named after the joint that it starts from ("LeftLeg" is a shank) or after
itself ("ltibia"); several bones of one joint have both names ("Hips-LeftUpLeg"). Some words depend on the others: a
"leg" above a "shin" is a thigh, a "foot" below an "ankle" the toes, a "shoulder" above an "elbow" an upper arm. Words
that most names share ("Robot_Hips"), and words besides most part names ("LeftLeg_bind" beside "hair_1"), are ignored.
Names in other languages are translated. The words are in `bone_names.toml`.
"""

import re
import tomllib
import unicodedata
from collections import Counter
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self, get_args

LimbPart = Literal["hip", "thigh", "shank", "foot", "clavicle", "upper arm", "forearm", "hand"]
Part = Literal["pelvis", "trunk", "neck", "head", "toes"] | LimbPart
Side = Literal["left", "right", "middle"]
SIDES: tuple[Side, Side] = ("left", "right")


class NamedPart(NamedTuple):
    """A part of the body and its side."""

    part: Part
    side: Side


_WORDS: dict[str, dict[Any, str]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_MIDDLE: dict[Part, str] = _WORDS["middle"]
_KEYS: dict[str, Part] = {
    word: part for table in ("middle", "sided") for part, words in _WORDS[table].items() for word in words.split()
}
_KEYS |= {"hip": "pelvis", "thorax": "trunk"}  # with a side they are limbs, which `_Style.part` knows


def _without_accents(name: str) -> str:
    """A name without accents; letters of other alphabets stay."""
    if name.isascii():
        return name
    marked = unicodedata.normalize("NFKD", name.replace("ß", "ss"))
    return unicodedata.normalize("NFC", "".join(c for c in marked if not "\u0300" <= c <= "\u036f"))


_ENGLISH = {_without_accents(word): english for english, words in _WORDS["foreign"].items() for word in words.split()}
_LEFT, _RIGHT = (frozenset(map(_without_accents, _WORDS["foreign_sides"][side].split())) for side in ("left", "right"))
_LEFT |= {"left", "l", "lt", "lf", "lft"}
_RIGHT |= {"right", "r", "rt", "rg", "rgt"}
_PREFIXES = re.compile(
    r"^(mixamorig\d*|character\d*|bip\d*|cc base|j bip|joint|jnt|def|org|mch|rl|b|[mf] avg|avg|bone|valvebiped)\b"
)
_RIGGED = re.compile(r"^(DEF|ORG|MCH)-")  # Blender's rigs
# Another part with a separate side: "r_larm" is a lower arm, "LArm" a left arm.
_SIDED_ONLY: dict[str, Part] = {"hip": "thigh", "thorax": "clavicle", "larm": "forearm", "lleg": "shank"}
# "LFArm" is a left forearm, though "lf" elsewhere means left.
_WHOLE = {f"{letter}{key}" for letter in "lr" for key in ("farm", "uarm")}
_KNOWN = frozenset(_KEYS) | frozenset(_ENGLISH)
_SILENT = ("c", "m", "x", "stretch")  # the middle; a bone of Auto-Rig Pro that deforms
_SHARED = 0.6  # of the names contain a word that is ignored
# The next parts: a bone "A-B" belongs to A only if B continues it.
_FOLLOWS: dict[Part, tuple[Part, ...]] = {
    "pelvis": ("trunk", "neck", "head", "pelvis"),
    "trunk": ("trunk", "neck", "head"),
    "neck": ("neck", "head"),
    "hip": ("hip", "thigh"),
    "thigh": ("thigh", "shank"),
    "shank": ("shank", "foot"),
    "foot": ("foot", "toes"),
    "clavicle": ("clavicle", "upper arm"),
    "upper arm": ("upper arm", "forearm"),
    "forearm": ("forearm", "hand"),
}

_THESIS = dict.fromkeys(("back", "neck"), NamedPart("trunk", "middle")) | {"head": NamedPart("head", "middle")}
# Suffixes of the thesis's bones on either side, and their parts.
THESIS_LIMBS: tuple[tuple[str, LimbPart], ...] = tuple(
    zip(("hip", "kne", "ank", "foo", "sho", "elb", "wri", "han"), get_args(LimbPart), strict=True)
)
_THESIS |= {side[0] + end: NamedPart(part, side) for side in SIDES for end, part in THESIS_LIMBS}
# Sides written together with a part, the longest first: "links" before "l".
_AFFIXES: list[tuple[str, Side]] = [(word, "left") for word in sorted(_LEFT, key=len, reverse=True)]
_AFFIXES.extend((word, "right") for word in sorted(_RIGHT, key=len, reverse=True))


class _Style(NamedTuple):
    """The naming convention of a skeleton."""

    shared: frozenset[str]  # ignored words, because most names contain them
    sided: dict[str, Part]  # the parts of words with a side that have another one here, or without it

    @classmethod
    def of(cls, names: Iterable[str]) -> Self:
        """The convention of names of joints or of bones between two joints ("A-B")."""
        joints = {joint for name in names for joint in _RIGGED.sub("", name).split("-")}
        said = [frozenset(_words(joint)) for joint in joints]
        counts = Counter(word for words in said for word in words)
        known = _LEFT | _RIGHT | _KNOWN
        shared: frozenset[str] = frozenset()
        if len(said) > 3:
            shared = frozenset(word for word, count in counts.items() if count > _SHARED * len(said))
            shared = (shared | _besides_parts(map(_words, joints))) - known
        keys = {_key(joint, shared)[0] for joint in joints}
        thighs = bool(keys & {"upleg", "upperleg", "legupper", "uleg", "thigh", "thighbend", "femur"})
        shins = bool(keys & {"shin", "calf", "shank", "lowerleg", "lowleg", "loleg", "leglower", "lleg", "knee"})
        uppers = {"upperarm", "uparm", "armupper", "arm", "uarm", "humerus"}
        others = {"elbow", "knee", "clavicle", "clav", "collar", "collarbone", "scapula"}
        depends: tuple[tuple[str, Part, bool], ...] = (
            ("hip", "hip", thighs),  # with a side it is above the thigh, because thighs have other names
            # Bones are named after joints, or collar bones have other names.
            ("shoulder", "upper arm", bool(keys & others) and not keys & uppers),
            ("leg", "thigh", shins and not thighs),  # a shin or a knee follows
            ("foot", "toes", "ankle" in keys),  # which precedes it
            ("wrist", "forearm", {"radius", "wrist", "hand"} <= keys),  # the far part of it, before a hand
        )
        sided: dict[str, Part] = {word: part for word, part, so in depends if so}
        return cls(shared, _SIDED_ONLY | sided)

    def part(self, name: str) -> NamedPart | None:
        key, side = _key(name, self.shared)
        part = self.sided.get(key) if side != "middle" else None
        part = part or _KEYS.get(key)
        return NamedPart(part, side) if part is not None and (part in _MIDDLE) == (side == "middle") else None


def named_parts(names: Iterable[str]) -> list[NamedPart | None]:
    """The body part of each name of a skeleton, or None."""
    return list(_named_parts(tuple(names)))


@lru_cache(maxsize=64)  # reading one recording evaluates its body in many poses
def _named_parts(names: tuple[str, ...]) -> tuple[NamedPart | None, ...]:
    if set(_THESIS) <= set(names):
        return tuple(_THESIS.get(name) for name in names)
    style = _Style.of(names)
    return tuple(_named(name, style) for name in names)


def _named(name: str, style: _Style) -> NamedPart | None:
    """The part of one bone: its own, or that of the joint it leads to."""
    start, *end = _RIGGED.sub("", name).split("-", 1)
    own = style.part(start)
    if not end:
        return own
    next_part = style.part(end[0])
    if own is not None and own.part in ("hand", "foot"):
        return own
    if own is None or next_part is None:
        return None
    if own.side == "middle" and next_part.part in ("hip", "thigh"):
        return NamedPart("hip", next_part.side)
    if own.side == "middle" and next_part.part in ("clavicle", "upper arm"):
        return NamedPart("clavicle", next_part.side)
    follows = next_part.part in _FOLLOWS.get(own.part, ()) and next_part.side in (own.side, "middle")
    return own if follows else None


@lru_cache(maxsize=4096)
def _words(name: str) -> tuple[str, ...]:
    """The words of a name in lower case, without the prefixes of common exporters."""
    name = _without_accents(re.split("[:|/]", name)[-1])
    name = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name)
    name = re.sub(r"([A-Z])([A-Z][a-z])", r"\1 \2", name)
    spaced = " ".join(re.sub(r"[\W_]+", " ", name.lower()).split())
    while (shorter := _PREFIXES.sub("", spaced).strip()) and shorter != spaced:
        spaced = shorter
    return tuple(spaced.split())


@lru_cache(maxsize=4096)
def _key(name: str, shared: frozenset[str]) -> tuple[str, Side]:
    """A name in English without prefix, separators, numbers and side; and its side."""
    return _english_key(tuple(word for word in _words(name) if word not in shared))


def _english_key(words: tuple[str, ...]) -> tuple[str, Side]:
    key, side = _sided_key(words)
    return _ENGLISH.get(key, key), side


def _besides_parts(names: Iterable[tuple[str, ...]]) -> frozenset[str]:
    """The words that most names contain besides the part: a prefix or suffix of an exporter."""
    parts: dict[frozenset[str], set[tuple[str, Side]]] = {}
    for words in names:
        if (found := _besides_part(words)) is not None:
            besides, part = found
            parts.setdefault(besides, set()).add(part)
    return max(parts, key=lambda words: (len(parts[words]), -len(words), sorted(words)), default=frozenset())


@lru_cache(maxsize=4096)
def _besides_part(words: tuple[str, ...]) -> tuple[frozenset[str], tuple[str, Side]] | None:
    """The words of a name besides the longest sequence that names a part, and that part; or None."""
    for count in range(len(words), 0, -1):
        for at in range(len(words) - count + 1):
            key, side = _english_key(words[at : at + count])
            if key in _KEYS:
                return frozenset(words[:at] + words[at + count :]), (key, side)
    return None


def _sided_key(words: tuple[str, ...]) -> tuple[str, Side]:
    """As `_key`, of the words of a name in its own language."""
    side: Side = "middle"
    kept: list[str] = []
    whole = "".join(words)
    if whole in _WHOLE:
        return whole[1:], "left" if whole[0] == "l" else "right"
    for word in words:
        bare = word.rstrip("0123456789")
        if bare in _LEFT | _RIGHT and side == "middle" and len(words) > 1 and not word[-1].isdigit():
            side = "left" if bare in _LEFT else "right"
        elif bare or len(words) == 1:
            kept.append(bare if bare not in ("", "l", "t") else word)
    key = "".join(word for word in kept if word not in _SILENT)
    if side == "middle" and key not in _KNOWN:
        for word, which in _AFFIXES:
            if key.startswith(word) and key[len(word) :] in _KNOWN:
                return key[len(word) :], which
            if key.endswith(word) and key[: -len(word)] in _KNOWN:
                return key[: -len(word)], which
    return key, side
