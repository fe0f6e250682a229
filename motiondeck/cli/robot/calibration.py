"""`motiondeck robot calibrate`: finds the model, tries the calibrated robot, and reports."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.optimize import nnls

from controller.library.motion_library import load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from motiondeck.cli.common.tables import show_table
from motiondeck.run.sampled_motions import as_clip
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library
from motiondeck_base.words import counted
from sim.models.robot_file import read_robot_file
from sim.retargeting.human_limbs import LIMBS
from sim.robots.calibrate import Calibration, calibrate
from sim.robots.carried_findings import segment_angles
from sim.robots.fidelity import Carried, carry
from sim.robots.limb_causes import Cause
from sim.robots.limb_directions import MEAN_LIMIT, SEGMENTS, WORST_LIMIT, LimbDirections, beyond_limits
from sim.robots.robot import Robot, load_robot

Directions = Mapping[str, tuple[float, float]]

# A calibrated robot is tried on these motions of a shipped library, for SECONDS each, at RATE Hz.
LIBRARY, MOTIONS, SECONDS, RATE = "thesis15", ("walk", "box1"), 1.5, 30.0
LOST = 60.0  # degrees on average
# Other knees and elbows are tried if hands or feet are farther off than this, in lengths of the limb; one replaces the
# first if they are then no farther off than this, in how far they were.
OFF, BETTER = 0.28, 0.7
WORDS = ("body (left)", "hinge (left)", "axis")  # columns of text


@dataclass(frozen=True)
class CalibrationTrial:
    """How a calibrated robot walked and boxed."""

    off: Directions  # how far each segment ("l_forearm") points from the human's: mean and worst, degrees
    causes: Mapping[str, Cause]  # of those that are further off in a motion than `robot check` allows

    @property
    def wrong(self) -> list[str]:
        """The segments that point elsewhere though the robot's joints could turn there."""
        return [name for name, cause in self.causes.items() if cause == "carried wrongly"]

    @property
    def lost(self) -> list[str]:
        """The segments that point too far elsewhere to be a human's, whatever the cause."""
        return [name for name, (mean, _) in self.off.items() if mean > LOST]


def try_robot(file: Path) -> CalibrationTrial:
    """Measures how the robot of a robot file walks and boxes."""
    off: dict[str, tuple[float, float]] = {}
    causes: dict[str, Cause] = {}
    for robot, carried, directions in _carried(file):
        for name, angle in segment_angles(robot, directions, carried, RATE).items():
            before = off.get(name, (0.0, 0.0))
            off[name] = (before[0] + angle.mean / len(MOTIONS), max(before[1], angle.worst))
            if angle.cause is not None and causes.get(name) != "carried wrongly":
                causes[name] = angle.cause
    return CalibrationTrial(off, causes)


def _carried(file: Path) -> Iterator[tuple[Robot, Carried, LimbDirections]]:
    """The robot of a robot file with each of the motions carried onto it, and its landmarks."""
    robot_file, library = read_robot_file(file), load_library(find_library(LIBRARY))
    for motion in MOTIONS:
        clip = as_clip(library, motion, SECONDS, RATE)
        robot = load_robot(file, clip.skeleton, dt=1.0 / clip.rate)
        carried = carry(clip, robot, SafetyEnvelope)
        yield robot, carried, LimbDirections(robot.model, robot_file.parts, np.array(robot_file.root_rotation))


def decided(model: Path, packages: Mapping[str, Path]) -> Calibration:
    """The calibration of a model; where several hinges may be its knees or elbows, with those that do best.

    Feet and hands tell: a robot with the right ones walks and boxes with them about where the human has them.
    FileFormatError as of `calibrate`.
    """
    found = calibrate(model, packages)
    chosen = dict[str, tuple[str, ...]]()
    if any(found.rivals.values()):
        least = off_reach(found)
        for limb, pairs in found.rivals.items():
            for pair in pairs if least.get(limb, 0.0) > OFF else ():
                with suppress(MotiondeckError):  # a hinge that cannot be one
                    off = off_reach(calibrate(model, packages, pair))[limb]
                    if off < BETTER * least[limb]:
                        least[limb], chosen[limb] = off, pair
    return calibrate(model, packages, [hinge for pair in chosen.values() for hinge in pair]) if chosen else found


def off_reach(found: Calibration) -> dict[str, float]:
    """How far feet ("leg") and hands ("arm") are from where the human's limbs lead, on average, in lengths of the limb.

    The lengths of the two segments are fitted to the robot's way from hip to foot or shoulder to hand.
    """
    off: dict[str, list[float]] = {limb: [] for limb in SEGMENTS}
    with TemporaryDirectory() as folder:
        file = Path(folder) / "robot.toml"
        file.write_text(found.to_toml(Path(folder)), encoding="utf-8")
        tried = [(directions.reaches(carried.qpos), carried.limbs) for _, carried, directions in _carried(file)]
    for name in tried[0][0]:
        side, _, limb = name.partition("_")
        ways = np.concatenate([reaches[name] for reaches, _ in tried])
        human = np.concatenate([limbs[:, [LIMBS.index(f"{side}_{s}") for s in SEGMENTS[limb]]] for _, limbs in tried])
        lengths = nnls(human.transpose(0, 2, 1).reshape(-1, 2), ways.ravel())[0]
        missed = np.linalg.norm(ways - np.einsum("p,tpi->ti", lengths, human), axis=1)
        off[limb].append(float(missed.mean() / np.linalg.norm(ways, axis=1).mean()))
    return {limb: float(np.mean(values)) for limb, values in off.items() if values}


def report_of(found: Calibration, file: Path, trial: CalibrationTrial) -> dict[str, Any]:
    """The report as one JSON object."""
    return {
        "file": str(file),
        "model": str(found.model),
        "sound": found.sound,
        "within_limits": not beyond_limits(trial.off),
        "joints": len(found.joints),
        "root_height_m": found.root_height,
        "parts": found.parts,
        "segments": [
            {
                "part": segment.part,
                "body": dict(zip("rl", segment.body, strict=True)),
                "hinge": dict(zip("rl", segment.hinge, strict=True)),
                "axis": dict(zip("rl", segment.axis.round(4).tolist(), strict=True)),
                "length_m": dict(zip("rl", segment.length.round(4).tolist(), strict=True)),
                "human_m": round(segment.human, 4),
            }
            for segment in found.segments
        ],
        "doubts": [
            {"part": doubt.part, "line": _line(file, doubt.part), "words": doubt.words, "fatal": doubt.fatal}
            for doubt in found.doubts
        ],
        "limbs_deg": {name: {"mean": mean, "worst": worst} for name, (mean, worst) in trial.off.items()},
        "limbs_why": dict(trial.causes),
        "solvers": ["ik", "angles"] if found.angles else ["ik"],
        "joints_without_range": list(found.unlimited),
        "joints_without_speed": [joint for joint in found.joints if joint not in found.speeds],
        "joints_not_played": list(found.unplayed),
        "joints_not_driven": list(found.undriven),
        "inertias_balanced": found.mended,
        "open_chains": found.open_chains,
        "off_when_standing_rad": found.missed,
    }


def print_report(found: Calibration, file: Path, trial: CalibrationTrial) -> None:
    """The report as tables and sentences."""
    print(f"wrote {file}: {len(found.joints)} joints, root {found.root_height:.3f} m above the floor when it stands")
    trunk = ", ".join(f"{part} is '{found.parts[part]}'" for part in ("pelvis", "chest", "head") if part in found.parts)
    print(trunk)
    rows = []
    for segment in found.segments:
        both = f"r_{segment.part}", f"l_{segment.part}"
        angles = [trial.off[name] for name in both if name in trial.off]
        rows.append(
            (
                segment.part.replace("_", " "),
                segment.body[1],
                segment.hinge[1],
                " ".join(f"{component:+.2f}" for component in segment.axis[1] + 0.0),
                *(f"{length:.3f}" for length in segment.length[::-1]),
                f"{segment.human:.3f}",
                f"{max(mean for mean, _ in angles):.0f}" if angles else "",
                f"{max(worst for _, worst in angles):.0f}" if angles else "",
            )
        )
    headings = ("segment", *WORDS, "left m", "right m", "human m", "off deg", "worst")
    show_table(headings, rows, left=WORDS)
    print("human: a human of the robot's height. off: the angle to the human's limb, walking and boxing.")
    for doubt in found.doubts:
        line = _line(file, doubt.part)
        where = f" (line {line} of {file}: {file.read_text(encoding='utf-8').splitlines()[line - 1]})" if line else ""
        part = f"{doubt.part}: " if doubt.part else ""
        print(f"{'error' if doubt.fatal else 'warning'}: {part}{doubt.words}{where}")
    for cause in dict.fromkeys(trial.causes.values()):
        names = [name for name, why in trial.causes.items() if why == cause]
        kind = "error" if cause == "carried wrongly" else "warning"
        print(f"{kind}: limbs that point elsewhere than the human's, {cause}: {', '.join(names)}")
    if trial.causes:
        print(
            f"in one motion more than {MEAN_LIMIT:.0f} degrees on average or {WORST_LIMIT:.0f} at worst; "
            "`robot check` fails there too, except for what its joints cannot reach"
        )
    if trial.lost:
        print(
            f"error: more than {LOST:.0f} degrees from the human's on average, so hardly its limbs: "
            f"{', '.join(trial.lost)}; if other bodies are, name them under [parts] of {file}"
        )
    if found.mended:
        print("some masses or inertias of the model are zero or cannot be: they are balanced (MuJoCo's balanceinertia)")
    if found.unlimited:
        have = f"{counted(len(found.unlimited), 'joint')} {'has' if len(found.unlimited) == 1 else 'have'}"
        print(f"{have} no range in the model: half a turn either way is a guess; edit it")
    unknown = len(found.joints) - len(found.speeds)
    if unknown:
        print(f"the model does not say how fast {counted(unknown, 'joint')} may turn: the robot file guesses; edit it")
    if found.unplayed:
        names = ", ".join(name or "a joint without a name" for name in found.unplayed)
        print(f"not played, because only hinges and ball joints with actuators are: {names}")
    if found.undriven:
        print(f"not played, because no actuator of the model drives them: {', '.join(found.undriven)}")
    if found.open_chains:
        print(
            f"closed chains of bodies ({counted(found.open_chains, 'connect or weld constraint')}) hold in physics "
            "(`play` without --kinematic), and are drawn open elsewhere"
        )
    print("solvers: ik, angles" if found.angles else "solvers: ik (its joints are not those of the angle solver)")


def _line(file: Path, part: str) -> int:
    """The line of a robot file that names the body of a part, from 1; 0 if there is none."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return next((k for k, line in enumerate(lines, 1) if part and line.startswith(f"{part} = ")), 0)


def packages(pairs: list[str]) -> dict[str, Path]:
    """The folders of packages given as NAME=DIR; MotiondeckError if a pair has no name, or no folder that exists."""
    found: dict[str, Path] = {}
    for pair in pairs:
        name, _, folder = pair.partition("=")
        if not name or not Path(folder).is_dir() or not folder:
            raise MotiondeckError(f"--package {pair}: give NAME=DIR with a folder that exists")
        found[name] = Path(folder)
    return found
