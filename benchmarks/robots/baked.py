"""Baked motions beside those carried live: joints, limbs, feet, tick.

Each motion is played from its beginning by two decks at 200 Hz, through the safety envelope: one carries the human
library to the robot in every tick, the other plays the library that was baked for it. A loop is compared in its second
round, a one-shot from its start to its end. Printed are for each motion

- the difference of the joints' angles: mean, 95 % and the worst, degrees;
- the angle from the robot's limbs to the human's in the world, live and baked: the mean over limbs, and that of the
  worst limb, degrees, by the landmarks of `robot check`, which neither way of carrying knows;
- the mean speed of the soles while the human's feet stand, mm/s, and how deep anything is in the floor, mm.

`motiondeck library bake` has made the libraries before. The joins are a sample of the grid of `joins`, in the angles of
the joints, with the worst speed and acceleration over the motions' own. The tick is that of `tick`, live and baked by
turns; the share of a core is what the loop takes with emulated servos at 100 Hz. For a Raspberry Pi the time in the
loop is multiplied by PI: how many times as long as here its core is assumed to take for Python. That is an estimate;
nothing was measured there.

python -m benchmarks baked thesis15:servo20 cmu86:servo20 thesis15:g1.toml cmu86:g1.toml --write docs/baked.md
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.command import run
from benchmarks.deck._tick_parts import ALL
from benchmarks.deck.joins import grid, summary
from benchmarks.deck.startup import start
from benchmarks.deck.tick import time_play
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary, load_library
from controller.loop.clock import Ticker
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.clip import Clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck.run.baked_libraries import kept_at
from motiondeck_base.shipped import find_library
from sim.models.robot_file import RobotFile
from sim.robots.catalogue import find_robot
from sim.robots.fidelity import floor_measures, lines_for
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import Robot, RobotLoader

RATE = 200.0
WAYS = ("live", "baked")
ROUNDS, TICKS = 3, 1000  # of the tick
# Of Python on this x86 core: an assumption, from public single-core benchmarks of the boards.
PI = {"Raspberry Pi 4 (Cortex-A72, 1.5 GHz)": 6.0, "Raspberry Pi 5 (Cortex-A76, 2.4 GHz)": 2.5}
_BETWEEN = re.compile(r"(<!-- baked, by benchmarks baked -->\n).*?(<!-- end of baked -->)", re.S)


@dataclass(frozen=True)
class Played:
    """A motion on a robot: T ticks."""

    angles: Array  # of the joints after the envelope, shape (T, J), rad
    qpos: Array  # shape (T, nq)
    poses: list[Pose]  # of the deck


def play(library: MotionLibrary, robot: Robot, motion: str, ticks: int) -> Played:
    """Plays a motion from its beginning."""
    deck, envelope = Deck(library, robot.retarget, motion), SafetyEnvelope(robot.limits, 1.0 / RATE)
    angles, qpos, poses = [], [], []
    state = robot.model.qpos0.copy()
    for tick in range(ticks):
        targets, pose = deck.update(1.0 / RATE)
        if tick == 0:
            envelope.start(np.clip(targets, robot.limits.lower, robot.limits.upper))
        safe = envelope(targets)
        robot.place(safe, pose, state)
        angles.append(safe.copy())
        qpos.append(state.copy())
        poses.append(pose)
    return Played(np.array(angles), np.array(qpos), poses)


def compare(library: MotionLibrary, baked: MotionLibrary, loader: RobotLoader, motion: str) -> dict[str, Any]:
    """The row of one motion."""
    info = next(one for one in library.info.motions if one.name == motion)
    ticks = round(info.frames / library.info.rate * RATE)
    first, ticks = (ticks, 2 * ticks) if info.plays == "loop" else (0, ticks)
    live_robot, baked_robot = loader(library.skeleton, None, 1.0 / RATE), loader(baked.skeleton, None, 1.0 / RATE)
    ways = {
        "live": play(library, live_robot, motion, ticks),
        "baked": play(baked, baked_robot, motion, ticks),
    }
    live, other = ways["live"].angles[first:], ways["baked"].angles[first:]
    off = np.degrees(np.abs(live - other))
    row: dict[str, Any] = {"mean": float(off.mean()), "p95": float(np.quantile(off, 0.95)), "worst": float(off.max())}
    row["worst_joint"] = live_robot.joints[int(off.max(axis=0).argmax())]
    poses = ways["live"].poses[first:]
    place, rotation = np.array([pose.root_position for pose in poses]), np.array([pose.rotation for pose in poses])
    clip = Clip(motion, library.skeleton, RATE, place, rotation)
    for way, played in ways.items():
        row |= {
            f"{way}_{name}": value for name, value in judge(clip, live_robot, loader.file, played.qpos[first:]).items()
        }
    return row


def judge(clip: Clip, robot: Robot, file: RobotFile, qpos: Array) -> dict[str, float]:
    """Limbs and feet of a robot that plays a clip."""
    directions = LimbDirections(robot.model, file.parts, np.array(file.root_rotation))
    limbs: list[float] = directions.degrees(qpos, lines_for(robot, clip)).mean(axis=0).tolist()
    floor = floor_measures(clip, robot, qpos, file.parts)
    return {
        "limbs_deg": float(np.mean(limbs)),
        "worst_limb_deg": max(limbs),
        "slide_mm_s": 1e3 * floor["slide"],
        "sunk_mm": 1e3 * floor["sunk"],
    }


def of_pair(name: str, robot_name: str, joins: int, tell: Callable[[str], None]) -> dict[str, Any]:
    """All of one library on one robot."""
    file, robot_file = find_library(name), find_robot(robot_name)
    kept = next(place for place in kept_at(file, robot_file) if place.is_file())
    library, baked, loader = load_library(file), load_library(kept), RobotLoader(robot_file)
    rows: dict[str, dict[str, Any]] = {}
    for motion in library.network.motions:
        rows[motion] = compare(library, baked, loader, motion)
        tell(f"{name} on {robot_file.stem}, {motion}: {rows[motion]}")
    sampled = grid(baked, None, 24, direct=False, sample=joins, seed=1)
    sizes = {"baked_mb": 1e-6 * kept.stat().st_size, "library_mb": 1e-6 * file.stat().st_size}
    found = {"library": name, "robot": robot_file.stem, "motions": rows, "joins": summary(sampled)} | sizes
    tell(f"joins: {found['joins']}")
    return found | ({"tick": of_tick(library, baked, tell)} if robot_name == "servo20" else {})


def of_tick(library: MotionLibrary, baked: MotionLibrary, tell: Callable[[str], None]) -> dict[str, dict[str, float]]:
    """Median tick, us, share of a core, %, and time to the first tick, s, live and baked: the least of some rounds."""
    found: dict[str, dict[str, list[float]]] = {"live": defaultdict(list), "baked": defaultdict(list)}
    for _ in range(ROUNDS):
        for way, played in (("live", library), ("baked", baked)):
            row = found[way]
            back, _ = time_play(played, "walk", VirtualClock(RATE), TICKS, rig=False, parts=False)
            loop, _ = time_play(played, "walk", Ticker(RATE), TICKS, rig=True, parts=False)
            _, share = time_play(played, "walk", Ticker(0.5 * RATE), TICKS, rig=True, parts=False, rate=0.5 * RATE)
            row["back to back, us"].append(float(np.median(back[ALL])))
            row["in the loop, us"].append(float(np.median(loop[ALL])))
            row["of a core at 100 Hz, %"].append(100.0 * share)
            with TemporaryDirectory() as empty:  # where nothing is baked, play is live
                home = os.environ.get("XDG_CACHE_HOME")
                os.environ |= {"XDG_CACHE_HOME": empty} if way == "live" else {}
                words = "walk", "--library", library.info.name, "--robot", "servo20"
                row["to the first tick, s"].append(start(Path(__file__).parents[2], *words, page=False)[0]["tick"])
                os.environ.pop("XDG_CACHE_HOME", None)
                os.environ |= {"XDG_CACHE_HOME": home} if home is not None else {}
            tell(f"{way}: " + ", ".join(f"{what} {values[-1]:.2f}" for what, values in row.items()))
    return {way: {what: min(values) for what, values in row.items()} for way, row in found.items()}


def table(pairs: list[dict[str, Any]]) -> str:
    """The tables of the docs."""
    lines = [
        "| | angles: mean, 95 %, worst (joint) | limbs to the human: live, baked | worst limb | soles slide, mm/s |"
        " into the floor, mm | joins beyond limits | file, MB (library) |",
        "|" + "---|" * 8,
    ]
    for pair in pairs:
        rows, joins = [*pair["motions"].values()], pair["joins"]
        worst = max(rows, key=lambda row: row["worst"])

        def both(name: str, digits: int, rows: list[dict[str, Any]] = rows) -> str:
            return ", ".join(f"{np.mean([row[f'{way}_{name}'] for row in rows]):.{digits}f}" for way in WAYS)

        means = [float(np.mean([row[name] for row in rows])) for name in ("mean", "p95")]
        cells = [
            f"{pair['library']} on {pair['robot']}",
            f"{means[0]:.1f}, {means[1]:.1f}, {worst['worst']:.0f} ({worst['worst_joint']})",
            both("limbs_deg", 1),
            both("worst_limb_deg", 1),
            both("slide_mm_s", 0),
            both("sunk_mm", 1),
            f"{joins['failing']} of {joins['joins']} (worst {joins['speed'][-1]}, {joins['acceleration'][-1]})",
            f"{pair['baked_mb']:.1f} ({pair['library_mb']:.1f})",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    for pair in pairs:
        if "tick" not in pair:
            continue
        ticks = pair["tick"]
        lines += ["", f"| {pair['library']} on servo20, walk | live | baked | ratio |", "|---|---|---|---|"]
        for what, live in ticks["live"].items():
            other = ticks["baked"][what]
            digits = 0 if other >= 100.0 else 2
            lines.append(f"| {what} | {live:.{digits}f} | {other:.{digits}f} | {other / live:.2f} |")
        for board, factor in PI.items():
            live, other = (1e-3 * factor * ticks[way]["in the loop, us"] for way in WAYS)
            lines.append(f"| {board}, estimate x {factor:g}: in the loop, ms | {live:.1f} | {other:.1f} | |")
    return "\n".join(lines) + "\n"


def main(
    pairs: Annotated[list[str], typer.Argument(metavar="LIBRARY:ROBOT...", help="What has been baked.")],
    joins: Annotated[int, typer.Option("--joins", help="How many joins of the grid are played.")] = 200,
    kept: Annotated[Path | None, typer.Option("--kept", help="A file for the figures of each pair, as JSON.")] = None,
    write: Annotated[Path | None, typer.Option("--write", help="The page that the tables are put into.")] = None,
) -> None:
    known = json.loads(kept.read_text()) if kept is not None and kept.exists() else {}
    for pair in pairs:
        if pair not in known:
            known[pair] = of_pair(*pair.split(":"), joins, lambda line: print(line, file=sys.stderr, flush=True))
        if kept is not None:
            kept.write_text(json.dumps(known))
    text = table([known[pair] for pair in pairs])
    print(text)
    if write is not None:
        write.write_text(_BETWEEN.sub(lambda m: m[1] + "\n" + text + "\n" + m[2], write.read_text()))


if __name__ == "__main__":
    run("baked", main, __doc__)
