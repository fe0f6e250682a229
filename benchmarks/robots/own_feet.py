"""Robots that walk 20 s on their own feet, and how straight their knees are.

Robots are the shipped ones, published humanoids in a folder of unpacked packages (--download fetches them), names,
models or robot files that are given, and humanoids written at random (`random7` is that of seed 7). Each plays a motion
with `--root free --walk` at tempo 1, without pushes. A robot without a table [walk] is tried, as `play --walk` does it;
a robot that is refused walks here all the same, with the last settings tried, to see whether that was right.

stood: s, by height and tilt of the root. knee, human: mean bend of a knee while its foot alone carries the body, and
off how far both are apart while both stand on that foot (mean, and p95), degrees. heel: pitch of the sole as it
leaves the floor, degrees. push: work of an ankle a step, while its foot touches, in percent of weight times the root's
height. With --rows FILE each run is added to a file of JSON lines, and those that are there are not done again. --set
bend=0.05 changes a setting of [walk], and such a robot is not tried. --film FILE draws the human and below it the
robots at the same times of the motion.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import msgspec
import mujoco
import typer

from benchmarks import command
from benchmarks.robots.own_feet_measure import Array, HumanLegs, walked
from benchmarks.robots.published_models import MODELS, fetch
from benchmarks.robots.random_humanoids import random_humanoid
from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary, load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.skeleton import Pose
from motiondeck.run.robots.walk_choice import WALKS, able_to_walk
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.physics_model import feet_of
from sim.physics.playback import PhysicsPlayback
from sim.physics.walk_trial import Course, play_course
from sim.physics.walking import walker
from sim.robots.calibrate import calibrate
from sim.robots.robot import DT, Robot, load_robot

SHIPPED = ("servo20", "mannequin")
BEGIN, APART, PICTURES = 6.0, 0.17, 8  # of a film, s
COLUMNS = {"knee": "knee", "human_knee": "human", "off": "off", "off_p95": "p95", "heel": "heel", "push": "push"}


def robot_file(name: str, models: Path, folder: Path) -> Path:
    """The file of a robot; a model is calibrated into a folder."""
    if name.endswith(".toml"):
        return Path(name)
    if name in SHIPPED:
        return find_robot(name)
    file = folder / f"{Path(name).stem}.toml"
    if not file.exists():
        model = next((models / model.file for model in MODELS if model.name == name), Path(name))
        if name.startswith("random"):
            model = folder / f"{name}.xml"
            model.write_text(random_humanoid(int(name[6:])))
        file.write_text(calibrate(model).to_toml(folder))
    return file


def played(robot: Robot, library: MotionLibrary, motion: str, seconds: float) -> tuple[Course, HumanLegs]:
    """A motion as it is commanded to a robot, and the legs of the human in it."""
    deck, legs = Deck(library, robot.retarget, motion), HumanLegs(library.skeleton)

    def play(dt: float) -> tuple[Array, Pose]:
        targets, pose = deck.update(dt)
        legs.add(pose)
        return targets, pose

    return play_course(robot, play, seconds, SafetyEnvelope), legs


def walking(robot: Robot, file: Path) -> tuple[str, PhysicsPlayback]:
    """Why a robot is refused, or "", and its stage; MotiondeckError if it has no two feet."""
    try:
        return "", PhysicsPlayback(able_to_walk(robot, file), DT, "free", walk=True)
    except MotiondeckError as error:
        check, walker.check_legs = walker.check_legs, lambda *_: None
        try:
            return str(error), PhysicsPlayback(replace(robot, walk=WALKS[-1]), DT, "free", walk=True)
        finally:
            walker.check_legs = check


def human_film(motion: str, library: MotionLibrary) -> tuple[str, mujoco.MjModel, list[Array]]:
    """The row of the human."""
    human = load_robot(find_robot("mannequin"), library.skeleton)
    deck, frames = Deck(library, human.retarget, motion), list[Array]()
    for _ in range(round((BEGIN + PICTURES * APART) / DT)):
        frames.append(human.model.qpos0.copy())
        human.place(*deck.update(DT), frames[-1])
    return "human", human.model, film_row(frames, 0.0)


def film_row(frames: Sequence[Array], late: float) -> list[Array]:
    """The pictures of a row, of frames DT apart, some seconds late; fewer after a fall."""
    ticks = [round((BEGIN + late + number * APART) / DT) for number in range(PICTURES)]
    return [frames[tick] for tick in ticks if tick < len(frames)]


def line(row: dict[str, Any]) -> str:
    """A run as text."""
    numbers = [row["stood_s"], *(row.get(column) for column in COLUMNS)]
    way = f"{row['walked_m'] / row['asked_m']:.0%}" if row.get("asked_m") else ""
    texts = " ".join("    -" if number is None else f"{number:5.1f}" for number in numbers)
    return f"{row['robot']:18.18} {row['motion']:14.14} {texts} {way:>5} {row['refused'][:160]}"


def main(
    robots: Annotated[list[str] | None, typer.Argument(help="Names, models or robot files.")] = None,
    models: Annotated[Path, typer.Option(help="A folder of unpacked packages.")] = Path("published-models"),
    download: Annotated[bool, typer.Option("--download", help="Fetch packages that are missing.")] = False,
    motions: Annotated[str, typer.Option(help="Of thesis15, or LIBRARY/MOTION; with commas.")] = "walk",
    seconds: Annotated[float, typer.Option(help="Of each run.")] = 20.0,
    rows: Annotated[Path | None, typer.Option(help="A file of JSON lines.")] = None,
    settings: Annotated[str, typer.Option("--set", help="Such as bend=0.05,toe=0.4.")] = "",
    film: Annotated[Path | None, typer.Option(help="A picture to draw.")] = None,
    written: Annotated[Path, typer.Option(help="A folder for calibrated robots.")] = Path("own-feet"),
) -> None:
    """Walks every robot."""
    names = robots or [*SHIPPED, *(model.name for model in MODELS if model.humanoid)]
    if download:
        fetch(models, {model.name for model in MODELS if model.humanoid})
    written.mkdir(exist_ok=True)
    changes = {name: float(value) for name, value in (part.split("=") for part in settings.split(",") if part)}
    lines = rows.read_text().splitlines() if rows is not None and rows.exists() else []
    done = {(row["robot"], row["motion"], str(row["set"])) for row in map(json.loads, lines)}
    strips: list[tuple[str, mujoco.MjModel, list[Array]]] = []
    print(f"{'robot':18} {'motion':14} stood {' '.join(f'{name:>5}' for name in COLUMNS.values())}   way")
    for name in names:
        for motion in motions.split(","):
            row: dict[str, Any] = {"robot": Path(name).stem, "motion": motion, "set": changes, "stood_s": None}
            if (row["robot"], motion, str(changes)) in done:
                continue
            *of, one = motion.split("/")
            library, frames = load_library(find_library(of[0] if of else "thesis15")), list[Array]()
            try:
                file = robot_file(name, models, written)
                robot = load_robot(file, library.skeleton)
                robot = replace(robot, walk=msgspec.structs.replace(robot.walk, **changes))
                course, legs = played(robot, library, one, seconds)
                row["refused"], stage = walking(robot, file)
                keep = [frames.append] if film is not None else []
                row |= walked(
                    stage, feet_of(robot), course, legs, lambda qpos, keep=keep: [k(qpos.copy()) for k in keep]
                )
                strips.append((row["robot"], robot.drawn, film_row(frames, stage.behind_s)))
                if film is not None and len(strips) == 1:
                    strips.insert(0, human_film(one, library))
            except MotiondeckError as error:
                row["refused"] = str(error)
            if rows is not None:
                with rows.open("a") as out:
                    out.write(json.dumps(row) + "\n")
            print(line(row), flush=True)
    if film is not None:
        from motiondeck.pictures.video import contact_sheet

        contact_sheet(strips, film, (240, 260))
        print(f"wrote {film}", file=sys.stderr)


if __name__ == "__main__":
    command.run("own_feet", main)
