"""`motiondeck robot`: lists and shows robots, writes robot files, tunes walks, checks how well a robot follows."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from motiondeck.cli.common.options import PAGE_PORT, JobsOption, JsonOption, PagePortOption, SolverOption
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import write_file
from motiondeck_base.jobs import Jobs
from motiondeck_base.progress import collected
from motiondeck_base.shipped import find_library, shipped_configs
from motiondeck_base.words import counted

if TYPE_CHECKING:
    from sim.robots.verdict import RobotVerdict

app = typer.Typer(help="List, show, calibrate and check robots.", no_args_is_help=True)

RobotArgument = Annotated[str, Argument(metavar="ROBOT", help="A robot file, or a name of `robot list --catalogue`.")]

CATALOGUE_KINDS = ("humanoid", "biped")
PICTURE_SECONDS, VIEW_SECONDS = 2.0, 8.0


@app.command("list")
def list_robots(
    catalogue: Annotated[bool, Option("--catalogue", help="Also list two-legged robots of MuJoCo Menagerie.")] = False,
    as_json: JsonOption = False,
) -> None:
    """List the included robots, and those to download.

    `motiondeck robot calibrate NAME` downloads a robot of the catalogue (extra: `menagerie`) and writes its robot file.

    Example:  motiondeck robot list --catalogue
    """
    from sim.models.robot_file import read_robot_file
    from sim.robots.catalogue import menagerie_package

    rows: list[dict[str, Any]] = []
    for path in sorted((shipped_configs() / "robots").glob("*.toml")):
        file = read_robot_file(path)
        rows.append({"name": file.name, "kind": file.kind, "solver": file.solver, "from": "motiondeck"})
    if catalogue:
        rows += [
            {"name": robot.name, "kind": robot.category, "solver": "", "from": f"menagerie ({robot.license})"}
            for robot in menagerie_package().robots()
            if robot.category in CATALOGUE_KINDS
        ]
    if as_json:
        print(json.dumps({"robots": rows}))
        return
    for row in rows:
        print(f"{row['name']:<22} {row['kind']:<10} {row['solver']:<8} {row['from']}")


@app.command("show")
def show(robot: RobotArgument, as_json: JsonOption = False) -> None:
    """Show a robot's joints, limits, rest pose, parts and solver.

    Example:  motiondeck robot show servo20
    """
    from motiondeck.cli.common.tables import show_table
    from sim.models.mannequin.mannequin import reference_body
    from sim.models.robot_file import read_robot_file
    from sim.robots.catalogue import find_robot
    from sim.robots.robot import load_robot

    path = find_robot(robot)
    file = read_robot_file(path)
    loaded = load_robot(path, reference_body())
    limits = loaded.limits
    figures = {"lower": limits.lower, "upper": limits.upper, "velocity": limits.velocity, "rest": loaded.rest}
    joints: list[dict[str, Any]] = [
        {"name": name} | {key: float(own[k]) for key, own in figures.items()} for k, name in enumerate(loaded.joints)
    ]
    report = {
        "name": file.name,
        "kind": file.kind,
        "solver": file.solver,
        "model": file.model,
        "mass_kg": float(loaded.model.body_mass.sum()),
        "root_height_m": file.root_height,
        "parts": file.parts,
        "joints": joints,
    }
    if as_json:
        print(json.dumps(report))
        return
    how = "exactly" if file.kind == "mannequin" else {"ik": "inverse kinematics", "angles": "angles"}[file.solver]
    print(f"{file.name}: {file.kind}, {counted(len(joints), 'joint')}, {report['mass_kg']:.1f} kg, posed by {how}")
    if file.kind == "mannequin":
        print("built from the skeleton of the motions; shown for an average body")
    rows = [(joint["name"], *(f"{joint[key]:.2f}" for key in figures)) for joint in joints]
    show_table(("joint", "lower rad", "upper rad", "speed rad/s", "rest rad"), rows)
    for part, body in file.parts.items():
        print(f"{part:<12} {body}")


@app.command("calibrate")
def calibrate(
    model: Annotated[str, Argument(metavar="MODEL", help="An MJCF or URDF file, or a name of the catalogue.")],
    out: Annotated[Path | None, Option(metavar="FILE", help="The robot file; by default NAME.toml.")] = None,
    package: Annotated[
        list[str] | None, Option(metavar="NAME=DIR", help="The folder of a package that a URDF's meshes are named by.")
    ] = None,
    force: Annotated[bool, Option("--force", help="Replace an existing robot file.")] = False,
    picture: Annotated[Path | None, Option(metavar="FILE", help="Draw robot and human side by side (.png).")] = None,
    view: Annotated[bool, Option("--view", help="Show robot and human side by side in the browser.")] = False,
    port: PagePortOption = PAGE_PORT,
    as_json: JsonOption = False,
) -> None:
    r"""Write a robot file for any humanoid model.

    Limbs, rest pose, size and heading are found in an MJCF or URDF. The table shows each limb segment beside that of a
    human of the same height; a mismatch is a warning with the line of the robot file to edit. Then the robot walks and
    boxes, and the angles between its limbs and the human's are shown in degrees; of a robot that can, the verdict of
    `preflight` on both motions follows. The exit code is 1 if a limb is missing or implausible, points elsewhere though
    the joints could turn there, or never points as the human's does.

    Look at the result with --view or --picture, edit the file where it is wrong (a wrong body under \[parts], real
    servo speeds under \[limits]), and check it: motiondeck robot check FILE RECORDINGS.

    [bold]Examples[/]

      motiondeck robot calibrate op3.xml --picture op3.png
      motiondeck play walk --robot op3.toml
    """
    from motiondeck.cli.common.options import check_new
    from motiondeck.cli.common.verdict_report import print_verdicts, verdicts_on
    from motiondeck.cli.robot.calibration import LIBRARY, MOTIONS, decided, packages, print_report, report_of, try_robot
    from sim.robots.catalogue import model_file

    found = decided(model_file(model), packages(package or []))
    file = out or Path(f"{found.name}.toml")
    check_new(file, force=force)
    write_file(file, found.to_toml(file.parent).encode())
    trial = try_robot(file)
    fails = not found.sound or trial.wrong or trial.lost
    if not as_json:
        print_report(found, file, trial)
    verdicts: list[RobotVerdict] = []
    if not fails:
        try:
            verdicts = verdicts_on(str(file), find_library(LIBRARY), MOTIONS)
        except MotiondeckError as error:  # the robot file is there, and can be played
            print(f"motiondeck: warning: {error}", file=sys.stderr)
    if as_json:
        print(json.dumps(report_of(found, file, trial) | {"verdicts": [verdict.row() for verdict in verdicts]}))
    elif verdicts:
        print_verdicts(verdicts, f"{LIBRARY} on {file.stem}")
    if picture is not None or view:
        from motiondeck.pictures.side_by_side import draw_beside, shipped_walk

        if picture is not None:
            draw_beside(shipped_walk(PICTURE_SECONDS), file, picture)
            print(f"wrote {picture}", file=sys.stderr)
        if view:
            from motiondeck.pictures.clip_scene import act_of
            from motiondeck.run.page.page import show_act

            show_act(act_of(shipped_walk(VIEW_SECONDS), file), port)
    if fails:
        raise typer.Exit(1)


@app.command("tune-walk")
def tune_walk(
    robot: RobotArgument,
    motion: Annotated[list[str] | None, Option(metavar="MOTION", help="A motion; repeatable. Default: walk.")] = None,
    library: Annotated[str, Option(metavar="LIBRARY", help="The library of the motions.")] = "thesis15",
    seconds: Annotated[float, Option(metavar="SECONDS", help="Length of each trial, s.")] = 60.0,
    rounds: Annotated[int, Option(metavar="N", min=0, help="Number of settings to try.")] = 40,
    jobs: JobsOption = "-1",
    as_json: JsonOption = False,
) -> None:
    """Tune how a robot walks under pushes.

    The settings are written into its robot file. Longer and longer steps are tried until the robot falls; the kept ones
    stay 15 % below that. `play --root free --walk` uses them.

    [bold]Example[/]

      motiondeck robot tune-walk my-robot.toml --motion walk --motion waltz
    """
    from motiondeck.cli.robot.tune_walk import report_text, tune
    from motiondeck.run.spec.run_spec import check_seconds
    from sim.robots.catalogue import find_robot

    check_seconds(seconds)
    report = tune(find_robot(robot), library, motion or ["walk"], seconds, rounds, Jobs.parse(jobs))
    print(json.dumps(report) if as_json else report_text(report))
    if not report["stood"]:
        raise typer.Exit(1)


@app.command("check")
def check(
    robot: RobotArgument,
    files: Annotated[list[Path], Argument(metavar="RECORDINGS", help="Recordings, or folders full of them.")],
    solver: SolverOption = None,
    seconds: Annotated[float | None, Option(metavar="SECONDS", help="Check so many first seconds of each.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure how well a robot follows recordings.

    Each recording is retargeted and has a row in the table. The last line counts the verdicts: how many play, play at a
    slower tempo, do not fit; lines above it give the verdict of each that does not play as it is, with limbs, degrees
    and what to do. A recording plays if these counts are zero, and limbs and trunk point as the human's do, as far as
    joints reach: bad (NaN or infinite), beyond (targets outside a joint's range), fast (steps faster than a joint
    may go), jumps (a joint goes far in one frame though the human does not). The exit code is 1 if one does not.

    changed is the share of targets that the safety envelope had to slow down. short and worst are how far inverse
    kinematics missed the ends of the limbs (rms and worst, mm); past is how many goals of the angle solver lay outside
    a joint's range. The angles between the robot's limbs and the human's follow, mean and worst in degrees, of the
    worse side, and the trunk's, for which there is no limit; then how fast standing soles slide (mm/s) and how deep
    anything sinks into the floor (mm).

    [bold]Examples[/]

      motiondeck robot check servo20 recordings/ --solver ik
      motiondeck robot check op3.toml walk.bvh jog.amc --json
    """
    from controller.motion.formats.reading import recordings_in
    from motiondeck.cli.robot.check import answer, passes, print_rows
    from motiondeck.cli.robot.check import check as rows_of
    from motiondeck.run.spec.run_spec import check_seconds
    from sim.models.robot_file import solver_named
    from sim.robots.catalogue import find_robot

    check_seconds(seconds)
    named = solver_named(solver)
    found = recordings_in(files)
    rows = collected(rows_of(find_robot(robot), found, named, seconds), "carrying", len(found))
    if as_json:
        judged = [row | {"verdict": row["verdict"].row()} if "verdict" in row else row for row in rows]
        print(json.dumps({"robot": robot, "solver": solver, "verdict": answer(rows), "recordings": judged}))
    else:
        print_rows(rows)
        print(answer(rows))
    if not all(map(passes, rows)):
        raise typer.Exit(1)
