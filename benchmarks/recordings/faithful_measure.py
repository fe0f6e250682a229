"""What is measured of a played motion against the landmarks of its file; numpy alone, nothing of the product.

Both are seen from the hips: the middle between them at the origin of the floor, the line through them along y. Height
is not aligned, so a wrong floor counts. What is played is scaled by the ratio of the legs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.recordings.faithful_files import Recorded, leg_length

Array = NDArray[np.float64]

LIMBS = {  # each with the landmark where it starts
    "kne": "hip",
    "ank": "kne",
    "foo": "ank",
    "elb": "sho",
    "wri": "elb",
    "han": "wri",
}
TRUNK = {"neck": "root", "back": "root", "head": "neck"}
HANGS = LIMBS | {"hip": "root", "sho": "neck"}  # where each landmark begins, for its distance
SHORTEST = 0.02  # m: shorter limbs point nowhere
SEAM = 0.4  # s on either side of a loop's seam, a quarter of the loop at most, whose errors are figures of their own
STOPS_WITHIN = 0.5  # s before and after the end of a one-shot in which it may be late, as one that slows down is
LATE_AT_MOST = 0.35  # s
LONGEST_DELAY = 0.05  # s that is looked for
MOVES = 0.1  # m/s: a mean speed of landmarks below which a delay cannot be told
STANDS = 0.15  # m/s
STANDS_SECONDS = 0.1
NEAR_GROUND = 0.05  # m above the lowest of a foot
NO_FLOOR = (-0.10, 0.25)  # m: feet of a file that stand outside this have no floor at 0
SOLE = (0.0, 0.12)  # m: how high ankles and toe bases that stand are above the floor
SHORTEST_PATH = 0.5  # m
ROUNDING = 0.01  # frames


@dataclass(frozen=True)
class Played:
    """What a library plays from the start of a motion: landmarks of bones by name, shape (T, 3), m, z up; Hz."""

    places: dict[str, Array]
    rate: float

    def at(self, seconds: Array) -> dict[str, Array]:
        """The landmarks at some times."""
        return {bone: _at(track, seconds * self.rate) for bone, track in self.places.items()}


@dataclass(frozen=True)
class Part:
    """The part of a file that is said to be learned, from and to, s, and how it plays ("loop" or "once")."""

    begin: float
    end: float
    plays: str


def measure(file: Recorded, played: Played, part: Part, lengths: int = 3) -> dict[str, object]:
    """The figures of a motion; those with a limb and a time name the worst place, in s of the run."""
    bones = [bone for bone in file.places if bone in played.places and bone != "root"]
    first, end = (int(np.ceil(at * file.rate - ROUNDING)) for at in (part.begin, part.end))
    frames = np.arange(first, min(end, len(file.places["root"])))
    scale = leg_length(file.places) / leg_length(played.places)
    lift = _floor_of_file(file)
    wanted = {bone: track - np.array([0.0, 0.0, lift]) for bone, track in file.places.items()}
    run = {bone: track * scale for bone, track in played.places.items()}
    whole = Played(run, played.rate)
    duration = part.end - part.begin
    if part.plays == "loop":
        frame = np.tile(frames.astype(float), lengths)
        when = ((frames / file.rate - part.begin)[None] + duration * np.arange(lengths)[:, None]).ravel()
        phase = when % duration
        apart = np.minimum(phase, duration - phase) < min(SEAM, 0.25 * duration)
    else:
        when = frames / file.rate - part.begin
        ending = np.arange(max(0.0, duration - STOPS_WITHIN), duration + STOPS_WITHIN, 1.0 / file.rate)
        when = np.concatenate([when[when < ending[0] - ROUNDING / file.rate], ending])
        frame = _nearest_late(wanted, whole, bones, frames, when, file.rate, part)
        apart = when >= duration - ROUNDING / file.rate
    ours = _seen(whole.at(when), bones)
    theirs = _seen({bone: _at(track, frame) for bone, track in wanted.items()}, bones)
    mm = 1000.0 * np.linalg.norm(ours - theirs, axis=-1)
    limbs = _limbs(bones, file.places)
    degrees = _between(ours, theirs, bones, limbs)
    ends = [limb for limb, _ in limbs]
    found: dict[str, object] = {
        f"{'seam' if part.plays == 'loop' else 'end'}_{name}": value
        for unit, off, names in (("mm", mm, bones), ("degrees", degrees, ends))
        for name, value in _figures(unit, off[apart], names, when[apart]).items()
    }
    own = 1000.0 * np.linalg.norm(_with_lengths_of(theirs, ours, bones) - theirs, axis=-1)
    found |= {
        "own_body_mm": float(np.quantile(own[~apart], 0.95)),
        **(_gap(wanted, bones, limbs, frames[0], round(part.end * file.rate)) if part.plays == "loop" else {}),
        **_figures("mm", mm[~apart], bones, when[~apart]),
        **_figures("degrees", degrees[~apart], ends, when[~apart]),
        "size": 1.0 / scale,
        "delay_ms": _delay(wanted, whole, bones, frames, file.rate, part),
    }
    if part.plays == "once":
        held = _seen({b: t[-1:] for b, t in run.items()}, bones)
        final = _seen({b: t[frames[-1] : frames[-1] + 1] for b, t in wanted.items()}, bones)
        found |= {
            "held_degrees": float(_between(held, final, bones, limbs).max()),
            "held_mm": float(1000.0 * np.linalg.norm(held - final, axis=-1).max()),
        }
    found |= _on_the_ground(wanted, whole, frames, file.rate, part, lift)
    return found


def _floor_of_file(file: Recorded) -> float:
    """Where the floor of a file is, m: 0, unless its feet stand elsewhere; then just below the lowest of them."""
    low = float(np.quantile(np.min([file.places[foot][:, 2] for foot in _feet(file.places)], axis=0), 0.05))
    return 0.0 if NO_FLOOR[0] < low < NO_FLOOR[1] else low - 0.5 * sum(SOLE)


def _feet(places: dict[str, Array]) -> list[str]:
    return [bone for bone in ("lfoo", "rfoo", "lank", "rank") if bone in places]


def _at(track: Array, place: Array) -> Array:
    place = np.clip(place, 0.0, len(track) - 1.0)
    low = np.minimum(place.astype(int), len(track) - 2)
    share = (place - low)[:, None]
    return track[low] * (1.0 - share) + track[low + 1] * share


def _seen(places: dict[str, Array], bones: list[str]) -> Array:
    """Landmarks seen from the hips, shape (T, B, 3)."""
    across = places["lhip"] - places["rhip"]
    turn = np.arctan2(-across[:, 0], across[:, 1])
    cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
    middle = 0.5 * (places["lhip"] + places["rhip"])
    x, y, z = np.moveaxis(np.stack([places[bone] for bone in bones], axis=1) - middle[:, None] * [1.0, 1.0, 0.0], -1, 0)
    return np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=-1)


def _limbs(bones: list[str], places: dict[str, Array]) -> list[tuple[str, str]]:
    """The limbs that can point somewhere, each by its end, with its start."""
    found = []
    for bone in bones:
        start = TRUNK.get(bone) or (bone[0] + LIMBS[bone[1:]] if bone[1:] in LIMBS else None)
        if start is None or (start not in bones and start != "root"):
            continue
        if np.median(np.linalg.norm(places[bone] - places[start], axis=-1)) > SHORTEST:
            found.append((bone, start))
    return found


def _with_lengths_of(theirs: Array, ours: Array, bones: list[str]) -> Array:
    """Played landmarks (T, B, 3) as far from each other as recorded ones, the lowest as high as it was."""
    out = ours.copy()
    middle = [0.5 * (seen[:, bones.index("lhip")] + seen[:, bones.index("rhip")]) for seen in (theirs, ours)]
    for index, bone in enumerate(bones):  # starts come before their ends
        start = TRUNK.get(bone) or (
            HANGS[bone[1:]] if HANGS[bone[1:]] in ("root", "neck") else bone[0] + HANGS[bone[1:]]
        )
        if start != "root" and start not in bones:
            continue
        at = bones.index(start) if start != "root" else None
        begins = [middle[turn] if at is None else seen[:, at] for turn, seen in enumerate((theirs, ours))]
        line = ours[:, index] - begins[1]
        length = np.linalg.norm(theirs[:, index] - begins[0], axis=-1, keepdims=True)
        out[:, index] = (middle[1] if at is None else out[:, at]) + line * (
            length / np.maximum(np.linalg.norm(line, axis=-1, keepdims=True), 1e-9)
        )
    out[..., 2] += (ours[..., 2].min(axis=1) - out[..., 2].min(axis=1))[:, None]
    return out


def _gap(
    wanted: dict[str, Array], bones: list[str], limbs: list[tuple[str, str]], first: int, end: int
) -> dict[str, object]:
    """Half of what a recording lacks of a loop at its ends: the least by which a seam can deviate there."""
    last = min(end, len(wanted["root"]) - 1)
    one, other = (_seen({bone: track[at : at + 1] for bone, track in wanted.items()}, bones) for at in (first, last))
    mm = 500.0 * np.linalg.norm(one - other, axis=-1)
    degrees = 0.5 * _between(one, other, bones, limbs)
    return {"gap_mm": float(np.quantile(mm, 0.95)), "gap_degrees": float(np.quantile(degrees, 0.95))}


def _between(ours: Array, theirs: Array, bones: list[str], limbs: list[tuple[str, str]]) -> Array:
    """Angles between limbs, shape (T, L), degrees."""
    angles = []
    for end, start in limbs:
        lines = []
        for seen in (ours, theirs):
            hips = 0.5 * (seen[:, bones.index("lhip")] + seen[:, bones.index("rhip")])
            line = seen[:, bones.index(end)] - (hips if start == "root" else seen[:, bones.index(start)])
            lines.append(line / np.linalg.norm(line, axis=-1, keepdims=True))
        half = np.linalg.norm(lines[0] - lines[1], axis=-1) / 2.0
        angles.append(np.degrees(2.0 * np.arcsin(np.clip(half, 0.0, 1.0))))
    return np.stack(angles, axis=1)


def _figures(unit: str, off: Array, names: list[str], when: Array) -> dict[str, object]:
    """Median, 95 % and worst over frames and joints, with the joint and the time; 95 % of each joint."""
    frame, joint = np.unravel_index(int(off.argmax()), off.shape)
    return {
        f"{unit}_median": float(np.median(off)),
        f"{unit}_p95": float(np.quantile(off, 0.95)),
        f"{unit}_worst": float(off.max()),
        f"{unit}_joint": names[joint],
        f"{unit}_time": float(when[frame]),
        f"{unit}_of": {name: float(np.quantile(off[:, index], 0.95)) for index, name in enumerate(names)},
    }


def _nearest_late(
    wanted: dict[str, Array],
    run: Played,
    bones: list[str],
    frames: NDArray[np.int64],
    when: Array,
    rate: float,
    part: Part,
) -> Array:
    """The recorded frame of each time of a one-shot: that of the time, and near its end the nearest one before it."""
    own = np.clip((when + part.begin) * rate, frames[0], frames[-1])
    limbs = _limbs(bones, wanted)
    early = np.arange(0.0, LATE_AT_MOST * rate, 0.25)
    for index in np.flatnonzero(when >= part.end - part.begin - STOPS_WITHIN):
        some = np.clip((when[index] + part.begin) * rate - early, frames[0], frames[-1])
        theirs = _seen({bone: _at(track, some) for bone, track in wanted.items()}, bones)
        ours = _seen(run.at(np.full(1, when[index])), bones)
        own[index] = some[_between(ours, theirs, bones, limbs).mean(1).argmin()]  # whoever's body plays it
    return own


def _delay(
    wanted: dict[str, Array], run: Played, bones: list[str], frames: NDArray[np.int64], rate: float, part: Part
) -> float | None:
    """By how much the first pass is late, ms (below 0: its first frames are left out); None where too little moves."""
    until = part.end - part.begin - (STOPS_WITHIN if part.plays == "once" else 0.0)
    when = frames / rate - part.begin
    keep = (when > LONGEST_DELAY) & (when < until - LONGEST_DELAY)
    if keep.sum() < 5:
        return None
    when, theirs = when[keep], _seen({bone: track[frames[keep]] for bone, track in wanted.items()}, bones)
    if np.linalg.norm(np.diff(theirs, axis=0), axis=-1).mean() * rate < MOVES:
        return None
    shifts = np.arange(-LONGEST_DELAY, LONGEST_DELAY + 1e-9, 0.0005)
    limbs = _limbs(bones, wanted)
    off = [np.square(_between(_seen(run.at(when + shift), bones), theirs, bones, limbs)).mean() for shift in shifts]
    return float(1000.0 * shifts[int(np.argmin(off))])


def _on_the_ground(
    wanted: dict[str, Array], run: Played, frames: NDArray[np.int64], rate: float, part: Part, lift: float
) -> dict[str, object]:
    """Slide and height of standing feet, recorded and played, and the ratio of the paths, over the first pass.

    Where a one-shot may be late feet are not judged, and its path ends when it has come to rest.
    """
    when = frames / rate - part.begin
    late = STOPS_WITHIN if part.plays == "once" else 0.0
    ours = run.at(when)
    theirs = {bone: track[frames] for bone, track in wanted.items()}
    slides: list[list[Array]] = [[], []]
    low: list[Array] = []
    played_low: list[Array] = []
    for foot in ("lfoo", "rfoo") if "lfoo" in theirs and "lfoo" in ours else ("lank", "rank"):
        track = theirs[foot]
        speed = np.linalg.norm(np.gradient(track, axis=0), axis=-1) * rate
        stands = (
            (speed < STANDS)
            & (when < part.end - part.begin - late)
            & (track[:, 2] < np.quantile(wanted[foot][:, 2], 0.05) + NEAR_GROUND)
        )
        for span in _spans(stands, round(STANDS_SECONDS * rate)):
            for kept, places in zip(slides, (track, ours[foot]), strict=True):
                kept.append(np.linalg.norm(places[span, :2] - places[span, :2].mean(0), axis=-1))
            low.append(ours[foot][span, 2] - track[span, 2])
            played_low.append(ours[foot][span, 2])
    found: dict[str, object] = {"slide_recorded_mm": None, "slide_played_mm": None, "floor_mm": None}
    if low:
        recorded_mm, played_mm = (1000.0 * float(np.quantile(np.concatenate(kept), 0.95)) for kept in slides)
        off = np.concatenate(low)
        if lift:  # a file without a floor: soles are somewhere above it
            feet = np.concatenate(played_low)
            off = feet - np.clip(feet, *SOLE)
        found = {
            "slide_recorded_mm": recorded_mm,
            "slide_played_mm": played_mm,
            "floor_mm": 1000.0 * float(off[np.abs(off).argsort()[int(0.95 * (len(off) - 1))]]),
        }
    whole = run.at(np.arange(when[0], part.end - part.begin + late, 1.0 / rate))
    ways = [
        float(np.linalg.norm(np.diff(0.5 * (p["lhip"] + p["rhip"])[:, :2], axis=0), axis=-1).sum())
        for p in (whole, theirs)
    ]
    return found | {"path_m": ways[1], "path_ratio": ways[0] / ways[1] if ways[1] > SHORTEST_PATH else None}


def _spans(mask: NDArray[np.bool_], shortest: int) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= max(2, shortest)]
