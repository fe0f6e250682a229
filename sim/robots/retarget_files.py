"""Retargets recordings to a robot, each into a training file, on many cores; a stopped run continues.

A manifest, `motions.jsonl`, beside the files has a line for robot and format, and one for each recording. A recording
with a line is not retargeted again unless it has changed.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from joblib import delayed

from controller.motion.canonical.clip_edits import breaks, resampled, without_reference_pose
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip, recordings_in
from controller.motion.formats.robot_motions import JOINTS_FILE
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import write_file
from motiondeck_base.jobs import EVERY_CORE, Jobs, spread
from sim.models.robot_file import Solver
from sim.robots.carried_findings import carried_findings, joint_findings, segment_angles
from sim.robots.fidelity import Carried, floor_measures, joint_measures, lines_for
from sim.robots.joint_motion import JointMotion, retargeted
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import Robot, RobotLoader
from sim.robots.robot_digest import robot_digest
from sim.robots.training_files import RATES, Format, write_training_file
from sim.robots.verdict import Finding, RobotVerdict, limited, verdict_of

MANIFEST = "motions.jsonl"
SUNK_LIMIT = 0.005  # largest depth in the floor, m
MARK = ".infeasible"  # before the suffix of files that a robot cannot do at this tempo


@dataclass(frozen=True)
class RetargetedFile:
    """The result for one recording."""

    recording: str  # the file it was read from
    file: str | None = None  # the file that was written; None with an `error`
    frames: int = 0  # of what was written
    fps: float = 0.0  # of what was written, Hz
    # The mean and the worst angle of each limb to the human's, by name ("r_thigh"), degrees.
    limbs_deg: dict[str, tuple[float, float]] = field(default_factory=dict)
    too_fast: int = 0  # steps faster than a joint may go
    sunk_m: float = 0.0  # the largest depth in the floor, m
    slide_m_s: float = 0.0  # the mean speed of the soles while the human's feet stand, m/s
    verdict: RobotVerdict | None = None  # whether the robot can do it, and at which tempo; None with an `error`
    notes: tuple[str, ...] = ()  # changes to the recording
    error: str | None = None  # why nothing was written
    size: int = 0  # of the recording, bytes, to detect changes
    changed: int = 0  # when the recording was, ns, to detect changes


class _Settings(msgspec.Struct, forbid_unknown_fields=True):
    """The first line of a manifest."""

    robot: str
    digest: str
    format: str
    solver: str | None


def retarget_files(
    robot: Path, paths: Sequence[Path], out: Path, format: Format, solver: Solver | None = None, jobs: Jobs = EVERY_CORE
) -> Iterator[RetargetedFile]:
    """Retargets recordings and writes a training file of each; yields each result as soon as it is done.

    Names and folders below `out` are those of the recordings. MotiondeckError if a path does not exist or two
    recordings have one file to write; if `out` holds motions of another robot, format or solver, or cannot be written.

    Args:
        paths: recordings, and folders of recordings.
        out: the folder for the files; created if missing.
        solver: in place of the robot file's.
        jobs: the processes; remote ones need the same paths.
    """
    places = _places(paths, format)
    settings = _Settings(robot.name, robot_digest(robot)[:16], format, solver)
    done = _opened(out, settings)
    left: list[tuple[Path, Path]] = []
    for recording, place in places.items():
        row, facts = done.get(str(recording)), recording.stat()
        now = facts.st_size, facts.st_mtime_ns
        if row and row.verdict and row.file and (row.size, row.changed) == now and (out / row.file).exists():
            yield row
        else:
            left.append((recording, place))
    carried, digest = delayed(_carried), settings.digest
    work = (carried(robot, digest, recording, out, place, format, solver) for recording, place in left)
    with MotiondeckError.writing(out), (out / MANIFEST).open("a", encoding="utf-8") as manifest:
        for row in spread(work, jobs):
            manifest.write(json.dumps(msgspec.to_builtins(row)) + "\n")
            manifest.flush()
            yield row


def _places(paths: Sequence[Path], format: Format) -> dict[Path, Path]:
    """Recording to output file, relative to the folder of the files."""
    places, ending = dict[Path, Path](), ".csv" if format == "csv" else ".npz"
    for path in paths:
        top = path if path.is_dir() else path.parent
        places |= {file: file.relative_to(top).with_suffix(ending) for file in recordings_in([path])}
    taken: dict[Path, Path] = {}
    for recording, place in places.items():
        other = taken.setdefault(place, recording)
        if other != recording:
            raise MotiondeckError(f"{recording} and {other} would both become {place}. Retarget them separately.")
    return places


def _opened(out: Path, settings: _Settings) -> dict[str, RetargetedFile]:
    """The rows of an earlier run, by recording; begins a manifest if there is none."""
    path = out / MANIFEST
    if out.exists() and not out.is_dir():
        raise MotiondeckError(f"{out} is a file, and --out names a folder for the motions. Give another.")
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            path.write_text(json.dumps(msgspec.to_builtins(settings)) + "\n", encoding="utf-8")
            return {}
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        if lines and not lines[-1].endswith("\n"):  # it was stopped while it wrote
            path.write_text("".join(lines[:-1]), encoding="utf-8")
            lines.pop()
    except OSError as error:
        raise MotiondeckError(f"{path}: cannot be used ({error.strerror or error}). Give another --out.") from None
    try:
        before = msgspec.json.decode(lines[0] if lines else "", type=_Settings)
        rows = [msgspec.json.decode(line, type=RetargetedFile) for line in lines[1:]]
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise MotiondeckError(f"{path}: no manifest of retargeted motions ({error}). Give another --out.") from None
    if before != settings:
        raise MotiondeckError(
            f"{out} holds motions for {before.robot} as {before.format}"
            + (", made before that robot was changed" if before.robot == settings.robot else "")
            + ". Give another --out, or delete it."
        )
    return {row.recording: row for row in rows}


@lru_cache(maxsize=1)
def _loader(robot: Path, digest: str) -> RobotLoader:
    return RobotLoader(robot)


def _carried(
    robot: Path, digest: str, recording: Path, out: Path, place: Path, format: Format, solver: Solver | None
) -> RetargetedFile:
    facts = recording.stat()
    known: dict[str, Any] = {"recording": str(recording), "size": facts.st_size, "changed": facts.st_mtime_ns}
    try:
        clip, left_out = without_reference_pose(read_clip(recording))
        notes = (f"a pose before the motion is left out, frames: {left_out}",) if left_out else ()
        _, parted = breaks(clip)
        clip = resampled(clip, RATES.get(format, clip.rate))
        loader = _loader(robot, digest)
        carry = partial(_carried_at, loader, None if loader.file.kind == "mannequin" else solver)
        fitted, motion, measured, found = carry(clip)
        found += [Finding("broken", 1.0, 0.0, "", where, ok=False) for where in parted]
        known |= {"frames": len(motion), "fps": clip.rate, "notes": notes} | measured
        known["verdict"] = verdict = verdict_of(
            recording.stem, found, lambda tempo: carry(replace(clip, rate=tempo * clip.rate))[-1]
        )
        marked = place if verdict.ok else place.with_suffix(MARK + place.suffix)
        (out / marked).parent.mkdir(parents=True, exist_ok=True)
        write_training_file(out / marked, fitted.model, motion.qpos, clip.rate, format)
        if not (names := out / JOINTS_FILE).exists():  # for their reader; what follows another joint after #
            joints = [fitted.model.joint(joint).name for joint in range(1, fitted.model.njnt)]
            write_file(names, "".join(f"{'# ' * (one not in fitted.joints)}{one}\n" for one in joints).encode())
        for other in {place, place.with_suffix(MARK + place.suffix)} - {marked}:
            (out / other).unlink(missing_ok=True)
        return RetargetedFile(file=str(marked), **known)
    except MotiondeckError as error:
        return RetargetedFile(error=str(error), **known)
    except Exception as error:  # one odd recording must not end a run over thousands
        return RetargetedFile(error=f"{recording}: {type(error).__name__}: {error}", **known)


def _carried_at(
    loader: RobotLoader, solver: Solver | None, clip: Clip
) -> tuple[Robot, JointMotion, dict[str, Any], list[Finding]]:
    """A clip on the robot at the clip's rate, with measures as of `RetargetedFile`, and the findings."""
    file, robot = loader.file, loader(clip.skeleton, solver, 1.0 / clip.rate)
    motion = retargeted(robot, clip)
    carried = Carried(motion.angles, motion.angles, motion.qpos, lines_for(robot, clip))
    counts = joint_measures(clip, robot, carried)
    found = joint_findings(counts)
    limbs: dict[str, tuple[float, float]] = {}
    floor = {"slide": 0.0, "sunk": 0.0}
    if file.parts:
        directions = LimbDirections(robot.model, file.parts, np.array(file.root_rotation))
        angles = segment_angles(robot, directions, carried, clip.rate)
        limbs = {name: (off.mean, off.worst) for name, off in angles.items()}
        found += carried_findings(robot, directions, carried, angles)
        floor = floor_measures(clip, robot, carried.qpos, file.parts)
        found.append(limited("into the ground", 1e3 * floor["sunk"], 1e3 * SUNK_LIMIT, "mm"))
    measures = {"limbs_deg": limbs, "too_fast": int(counts["too_fast"])}
    return robot, motion, measures | {"sunk_m": floor["sunk"], "slide_m_s": floor["slide"]}, found
