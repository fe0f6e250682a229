"""`motiondeck retarget`: writes recordings as motions of a robot, for training tracking policies."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import typer
from typer import Argument, Option

from motiondeck.cli.common.options import JobsOption, JsonOption, SolverOption
from motiondeck.cli.common.tables import show_table
from motiondeck_base.progress import collected, progress
from motiondeck_base.words import counted

if TYPE_CHECKING:
    from controller.motion.clip import ReadingOptions
    from sim.models.robot_file import Solver
    from sim.physical.files import StoodFile
    from sim.robots.retarget_files import RetargetedFile
    from sim.robots.training_files import Format

SEGMENTS = ("thigh", "shank", "upper_arm", "forearm")


def retarget(
    recordings: Annotated[list[Path], Argument(metavar="FILE_OR_FOLDER...", help="Recordings, or folders of them.")],
    robot: Annotated[str, Option(metavar="ROBOT", help="A robot file (.toml) or a name (`robot list`).")],
    out: Annotated[Path, Option(metavar="DIR", help="The folder for the files; created if missing.")],
    format: Annotated[Literal["npz", "csv", "mjlab", "qpos"], Option(help="The files' format.")] = "npz",
    physical: Annotated[bool, Option("--physical", help="As a simulated robot on its feet; takes minutes.")] = False,
    solver: SolverOption = None,
    jobs: JobsOption = "-1",
    as_json: JsonOption = False,
) -> None:
    """Carry recordings onto a robot, as motion files for training.

    npz: fps, joint_names, root_pos, root_quat (w x y z) and joint_pos. csv: at 30 Hz, a row per frame: root x y z,
    quaternion x y z w, joints, as Unitree's retargeted LAFAN1 set. mjlab: the npz of its tracking task, at 50 Hz. qpos:
    fps, qpos and qvel of MuJoCo. npz and qpos keep the recording's rate. Joints are in the model's order.

    All cores work, or with --jobs dask://HOST:PORT a cluster whose workers see the same folders. The run can be
    stopped at any time: the same command continues, and repeats a recording only if it has changed. motions.jsonl
    beside the files has the result of each.

    The table shows the angles between the robot's limbs and the human's (mean/worst, of the worse side, degrees), steps
    faster than a joint may go (fast), how deep anything sinks into the floor (mm) and how fast standing soles slide
    (mm/s), and the verdict: plays, at tempo 0.54 (the fastest that the robot can follow), or does not fit. What does
    not play at its own tempo is written as NAME.infeasible.npz, with the reason below the table: a limb further off
    than 15 degrees on average or 45 at worst, or 25 on average where joints cannot reach; the trunk beyond 8 and 20;
    steps too fast, jumps, anything 5 mm in the floor. The exit code is 1 if a recording could not be carried at all.

    With --physical each motion is changed, by simulations on all cores, until the robot can do it on its own feet from
    the motion's first posture and speed, or the second is found at which it falls: 50 Hz, in --out without folders. It
    takes about 7 s of processor time a second (G1), and where it falls, and is searched in another way, 6 s more.

    [bold]Examples[/]

      motiondeck retarget recordings/ --robot g1.toml --out motions --format mjlab
      motiondeck retarget walk.bvh dance.c3d --robot g1.toml --out motions --format csv
      motiondeck retarget walk.bvh --robot g1.toml --out motions --physical
    """
    from controller.motion.formats.reading import recordings_in
    from motiondeck_base.jobs import Jobs
    from sim.models.robot_file import solver_named
    from sim.robots.catalogue import find_robot
    from sim.robots.retarget_files import retarget_files
    from sim.robots.training_files import format_named

    named, how, where = format_named(format), solver_named(solver), Jobs.parse(jobs)
    if physical:
        stood = stand(recordings_in(recordings), find_robot(robot), out, named, how)
        if as_json:
            print(json.dumps({"robot": robot, "recordings": msgspec.to_builtins(stood)}))
        else:
            print_stood(stood, out)
        raise typer.Exit(int(any(row.error for row in stood)))
    carried = retarget_files(find_robot(robot), recordings, out, named, how, where)
    rows = collected(carried, "retargeting", len(recordings_in(recordings)))
    rows.sort(key=lambda row: row.recording)
    if as_json:
        print(json.dumps({"robot": robot, "format": named, "recordings": msgspec.to_builtins(rows)}))
    else:
        print_rows(rows, out)
    raise typer.Exit(int(any(row.error for row in rows)))


def print_rows(rows: list[RetargetedFile], out: Path) -> None:
    """Prints the table, notes, infeasible and failed recordings, and the sums."""
    from sim.robots.verdict import summed

    segments = [name.replace("_", " ") for name in SEGMENTS]
    headings = ("recording", "frames", "fps", *segments, "fast", "sunk", "slide", "verdict")
    lines, written = [], [row for row in rows if row.error is None]
    for row in written:
        cells = [str(row.frames), f"{row.fps:g}", *(worse_side(row.limbs_deg, name) for name in SEGMENTS)]
        cells += [str(row.too_fast), f"{1000.0 * row.sunk_m:.1f}", f"{1000.0 * row.slide_m_s:.0f}"]
        lines.append((Path(row.recording).name, *cells, row.verdict.answer if row.verdict else ""))
    show_table(headings, lines)
    for row in rows:
        for note in row.notes:
            print(f"{row.recording}: {note}")
    for row in rows:
        if row.verdict and not row.verdict.ok:
            print(f"{row.recording}: {row.verdict.words}")
    for row in rows:
        if row.error is not None:
            print(f"failed: {row.error}")
    seconds = sum(row.frames / row.fps for row in written)
    verdicts = summed(row.verdict for row in written if row.verdict)
    failed = len(rows) - len(written)
    print(f"{counted(len(written), 'motion')}, {seconds:.0f} s, in {out}: {verdicts or 'none'}; {failed} failed")


def worse_side(limbs: dict[str, tuple[float, float]], segment: str) -> str:
    """Mean and worst angle of a segment, of the side where it is worse: "4/12"."""
    both = [limbs[name] for name in (f"r_{segment}", f"l_{segment}") if name in limbs]
    return f"{max(mean for mean, _ in both):.0f}/{max(worst for _, worst in both):.0f}" if both else ""


def stand(
    recordings: Sequence[Path],
    robot: Path,
    out: Path,
    format: Format = "npz",
    solver: Solver | None = None,
    options: ReadingOptions | None = None,
    feedback: bool = False,
) -> list[StoodFile]:
    """Looks for each recording's motion on the robot's feet; a terminal shows how far it is."""
    from controller.motion.clip import AS_FOUND
    from sim.physical.files import stood_files

    with progress("", None) as tick:

        def show(name: str, seconds: float) -> None:
            tick(f"{name}: stands for {seconds:.1f} s")

        return [*stood_files(robot, recordings, out, format, solver, show, options or AS_FOUND, feedback)]


def print_stood(rows: Sequence[StoodFile], out: Path) -> None:
    """Prints which motions stand to the end, and when others fall."""
    lines, written = [], [row for row in rows if row.error is None]
    for row in written:
        plain = "stands" if row.plain_s is None else f"falls at {row.plain_s:.2f} s"
        found = f"stands, {row.seconds:.1f} s" if row.fell_s is None else f"falls at {row.fell_s:.2f} s"
        found += "" if row.held is None else f", {row.held:.0%} with feedback"
        lines.append((Path(row.recording).name, plain, found, f"{row.path_m:.2f}", f"{row.pose_deg:.0f}"))
    show_table(("recording", "targets alone", "with offsets", "path m", "pose deg"), lines)
    for row in rows:
        if row.error is not None:
            print(f"failed: {row.error}")
    stands, failed = sum(row.stands for row in rows), len(rows) - len(written)
    print(f"{counted(len(written), 'motion')} in {out}: {stands} to the end on its feet; {failed} failed")
