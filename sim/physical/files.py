"""Recordings as a robot does them on its own feet: a training file of each.

NAME.npz is what the simulated robot did (`training_files`); NAME.infeasible.npz, to the second at which it fell.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from controller.motion.canonical.clip_edits import resampled, without_reference_pose
from controller.motion.clip import AS_FOUND, ReadingOptions
from controller.motion.formats.reading import read_clip
from motiondeck_base.errors import MotiondeckError
from sim.models.robot_file import Solver
from sim.physical.feedback_fit import fitted_feedback
from sim.physical.stage import RATE, PhysicalStage
from sim.physics.feedback import SUFFIX
from sim.robots.joint_motion import retargeted
from sim.robots.retarget_files import MARK
from sim.robots.robot import RobotLoader
from sim.robots.training_files import Format, write_training_file


@dataclass(frozen=True)
class StoodFile:
    """The result for one recording."""

    recording: str  # the file it was read from
    file: str | None = None  # the file that was written; None with an `error`
    seconds: float = 0.0  # of the motion
    fell_s: float | None = None  # time of the fall; None if the robot stands to the end
    plain_s: float | None = None  # time of its fall with the carried targets alone
    path_m: float = 0.0  # mean distance from the carried path
    pose_deg: float = 0.0  # root mean square of the joints' differences from the carried ones
    held: float | None = None  # share of simulations from other starts that stand to the end with its feedback
    error: str | None = None  # why nothing was written

    @property
    def stands(self) -> bool:
        """Whether the robot does the motion to the end."""
        return self.error is None and self.fell_s is None


def stood_files(
    robot: Path,
    paths: Sequence[Path],
    out: Path,
    format: Format = "npz",
    solver: Solver | None = None,
    progress: Callable[[str, float], None] = lambda name, seconds: None,
    options: ReadingOptions = AS_FOUND,
    feedback: bool = False,
) -> Iterator[StoodFile]:
    """Looks for each recording's motion on its feet and writes it; yields each result as soon as it is done.

    `progress` gets the recording's name and the seconds found; `options` are of reading.
    With `feedback`, that of a motion that stands is written beside it. MotiondeckError for format
    csv, whose rate is another, for two recordings of one name, and if `out` cannot be written.
    """
    if format == "csv":
        raise MotiondeckError(f"--format csv has 30 Hz, and these motions have {RATE:g}. Give npz, mjlab or qpos.")
    if twice := next((path for at, path in enumerate(paths) if path.stem in {one.stem for one in paths[:at]}), None):
        raise MotiondeckError(f"{twice}: another recording has this name, and they would be one file. Rename one.")
    loader = RobotLoader(robot)
    for path in paths:
        try:
            clip = read_clip(path, options)
            if clip.skeleton.is_rig:
                raise MotiondeckError(f"{path}: these joint angles have lost their path. Give the human's recording.")
            clip = resampled(without_reference_pose(clip)[0], RATE)
            fitted = loader(clip.skeleton, solver, 1.0 / RATE)
            stage = PhysicalStage(fitted, retargeted(fitted, clip))
            found = stage.best(progress=partial(progress, path.name))
            place = out / f"{path.stem}{'' if found.fell_s is None else MARK}.npz"
            with MotiondeckError.writing(out):
                out.mkdir(parents=True, exist_ok=True)
            write_training_file(place, fitted.model, found.motion.qpos, RATE, format)
            held = None
            if feedback and found.fell_s is None:
                fitted, held = fitted_feedback(stage, found)
                fitted.save(place.with_suffix(SUFFIX))
            seconds, errors = (len(clip) - 1) / RATE, (found.path_m, found.pose_deg)
            yield StoodFile(str(path), place.name, seconds, found.fell_s, stage.plain(), *errors, held)
        except MotiondeckError as error:
            yield StoodFile(str(path), error=str(error))
