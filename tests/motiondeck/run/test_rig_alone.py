"""A rig alone in a run: what is played on it, what is refused, what its page and its recording show."""

import json

import numpy as np
import pytest

from command_line import invoked
from controller.motion.formats.reading import read_clip
from controller.motion.formats.taught_clip import save_taught_clip, taught_clip
from controller.wire.run_recording import load_recording
from motiondeck.run.robots.rig_on_deck import RigFigure, recorded_deck, robot_of
from motiondeck.run.robots.robot_on_deck import with_robot
from motiondeck.run.spec.program import Program
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError
from simulated_bodies import human
from waiting import tried

RIG = """
port = "/dev/nowhere"
baud = 1000000
rate_hz = 50
joints = [
  { name = "jaw", id = 1, model = "XL330-M288", direction = 1, zero = 2048, lower = -1.0, upper = 1.0, velocity = 5.0 },
  { name = "pan", id = 2, model = "XL330-M288", direction = 1, zero = 2048, lower = -1.0, upper = 1.0, velocity = 5.0 },
]
"""


@pytest.fixture
def rig(tmp_path):
    file = tmp_path / "head.toml"
    file.write_text(RIG)
    return file


@pytest.fixture
def clip(tmp_path):
    file, t = tmp_path / "talk.clip", np.arange(60) / 50.0
    save_taught_clip(taught_clip("talk", ("jaw",), 50.0, 0.3 * np.sin(2 * np.pi * t)[:, None]), file)
    return file


def test_the_robot_of_a_run_follows_from_what_is_played_on_which_rig(rig, clip):
    taught, body = Program.of(RunSpec(motion=str(clip), rig=str(rig))).source.skeleton, human()
    assert with_robot(RunSpec(), body).robot == "mannequin"
    assert with_robot(RunSpec(robot="servo20", rig="pan-tilt"), body).robot == "servo20"
    assert with_robot(RunSpec(rig="emulated:servo20"), body).robot == "servo20"
    assert with_robot(RunSpec(rig=str(rig)), taught).robot is None
    assert with_robot(RunSpec(rig=f"emulated:{rig}"), taught).robot is None
    with pytest.raises(MotiondeckError, match=r"head.toml: motions of bodies need a robot.*--robot.*--library"):
        with_robot(RunSpec(rig=str(rig)), body)


def test_a_library_file_or_with_a_rig_a_clip_stands_for_the_motion(rig, clip, tmp_path):
    program = Program.of(RunSpec(motion=str(clip), rig=str(rig)))
    assert (program.source.name, program.first, program.file) == ("talk", "talk", None)
    with pytest.raises(MotiondeckError, match=r"a file, not a motion of thesis15\. Learn it"):
        Program.of(RunSpec(motion=str(clip)))
    (tmp_path / "robot.xml").write_text("<mujoco/>")
    with pytest.raises(MotiondeckError, match=r"a robot's model; .*motiondeck robot calibrate .*robot\.xml$"):
        Program.of(RunSpec(motion=str(tmp_path / "robot.xml")))
    with pytest.raises(MotiondeckError, match=r"--show is for a library.*motiondeck learn .*talk.clip"):
        Program.of(RunSpec(motion=str(clip), rig=str(rig), show="gala/head"))
    library = rig.with_suffix(".safetensors")
    assert invoked("learn", str(clip), "--out", str(library), "--force").exit_code == 0
    assert (rig.read_text(), (tmp_path / "head.recipe.toml").exists()) == (RIG, True)  # the rig file is no recipe
    program = Program.of(RunSpec(motion=str(library)))
    assert (program.file, program.first) == (library, "talk")


def test_a_loop_of_keyframes_is_played_again_and_again_and_any_other_once(rig, tmp_path):
    keys = ", ".join(f'{{ at = {at}, joint = "jaw", value = {value} }}' for at, value in ((0, 0), (0.5, 20), (1, 0)))
    for plays in ("loop", "once"):
        (tmp_path / "talk.toml").write_text(f'unit = "deg"\nlength = 1.0\nplays = "{plays}"\nkey = [{keys}]')
        clip = read_clip(tmp_path / "talk.toml")
        deck = recorded_deck(clip, robot_of(rig, clip.skeleton).retarget)
        jaw = np.degrees([deck.update(0.05)[0][0] for _ in range(50)])
        assert jaw[9] == pytest.approx(20.0)
        assert jaw[[19, 29, 39, 49]] == pytest.approx(
            [0.0, 20.0, 0.0, 20.0] if plays == "loop" else 4 * [0.0], abs=1e-6
        )
        assert deck.over == (plays == "once")


@pytest.mark.parametrize(
    "option", [("--walk",), ("--kinematic",), ("--root", "free"), ("--solver", "ik"), ("--check-collisions",)]
)
def test_an_option_of_simulated_robots_is_refused_by_name(rig, clip, option):
    words = ("play", str(clip), "--rig", f"emulated:{rig}", "--headless", "--command-port", "0", *option)
    with pytest.raises(MotiondeckError, match=f"{option[0]} is for a simulated robot, and a rig alone has none"):
        invoked(*words, catch_exceptions=False)


def test_the_figure_stands_where_the_servos_are_and_shows_their_targets(rig, clip):
    class Servos:
        positions = np.array([0.2, -0.1])

    robot = robot_of(rig, Program.of(RunSpec(motion=str(clip), rig=str(rig))).source.skeleton)
    figure = RigFigure(robot, Servos())
    Servos.positions = np.array([0.4, 0.0])
    figure.write(np.array([0.5, 0.1]), None)
    places = robot.layout.hinge_qpos
    assert figure.qpos[places].tolist() == [0.4, 0.0]
    assert figure.wanted[places].tolist() == [0.5, 0.1]


@pytest.mark.thorough
def test_a_run_of_a_rig_alone_is_switched_by_a_script_recorded_and_replayed(rig, clip, tmp_path):
    library, out = tmp_path / "gestures.safetensors", tmp_path / "run.rec"
    swing = 0.3 * np.sin(np.linspace(0.0, 8 * np.pi, 200, endpoint=False))
    for name, both in (("talk", (swing, 0 * swing)), ("nod", (0 * swing, swing))):
        save_taught_clip(taught_clip(name, ("jaw", "pan"), 50.0, np.stack(both, axis=1)), tmp_path / f"{name}.clip")
    assert invoked("learn", str(clip), str(tmp_path / "nod.clip"), "--out", str(library)).exit_code == 0
    common = ("--headless", "--command-port", "0", "--json")
    rigged = ("--rig", f"emulated:{rig}", "--script", "talk 1.5, nod 2", "--record", str(out))

    def play():
        said = invoked("play", "--library", str(library), *rigged, *common, catch_exceptions=False)
        report = json.loads(said.stdout.splitlines()[-1])
        assert (report["robot"], [switch["to"] for switch in report["switches"]]) == ("head", ["nod"])
        assert report["rig"]["joints"] == 2
        swing = np.ptp(load_recording(out).fields["measured"], axis=0)
        assert swing == pytest.approx([0.6, 0.6], abs=0.15)

    tried(play)
    again = json.loads(invoked("replay", str(out), *common, catch_exceptions=False).stdout.splitlines()[-1])
    assert (again["reason"], again["rig"]["joints"]) == ("played to the end", 2)
