"""Any number in any file that a user writes: it is taken, or refused in lines that name file and key."""

import re
import shutil
import warnings
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors import safe_open
from safetensors.numpy import save_file

import synthetic
from controller.deck.deck import Deck
from controller.learning.recipe import read_recipe
from controller.library.motion_library import load_library, save_library
from controller.loop.safety.approach import Approach
from controller.loop.safety.safety_envelope import SafetyEnvelope
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import load_rig
from hardware.rig.scale import RigScale
from motiondeck.run.spec.program import read_timeline
from motiondeck.shows.show_file import read_show
from motiondeck.stage.stage_file import read_stage
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import shipped_configs
from sim.models.robot_file import read_robot_file
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human

HOSTILE = [
    "9" * 400,
    "-" + "9" * 400,
    "1" * 5000,
    "0x" + "f" * 5000,
    "18446744073709551616",
    "9223372036854775807",
    "-9223372036854775808",
    "1e308",
    "-1e308",
    "1e-308",
    "5e-324",
    "1e154",
    "1e39",
    "1e15",
    "1e-12",
    "-1e15",
    "1e999",
    "nan",
    "-inf",
    "-0.0",
    "0",
    "-1",
]
LONGEST = 300  # characters of a line after the file
NUMBER = re.compile(r"(?<![\w.\"#/-])-?\d[\d_]*(?:\.\d+)?(?:e-?\d+)?(?![\w.\"])")

RIG = """port = "/dev/ttyUSB0"
baud = 1000000
rate_hz = 100
watchdog_ms = 200
read_hz = 50
reconnect_s = 10
[[joints]]
name = "pan"
id = 1
model = "XM430-W350"
direction = 1
zero = 2048
lower = -1.5
upper = 1.5
velocity = 4.0
acceleration = 20.0
current = 1.0
gear = 1.0
"""
SHOW = """show = "gala"
lead = 0.5
lost_after = 3
[[cues]]
at = 2.0
say = "tempo 0.8"
in_step = 1.5
[[cues]]
when = "here"
within = 3
say = "input speed 1.5"
"""
STAGE = """[osc]
listen = 9000
send_to = "127.0.0.1:9001"
[osc.commands]
"/a" = "tempo 0.5"
[midi]
input = "port"
channel = 10
[midi.notes]
36 = "tempo 1.5 2"
[midi.timecode]
"01:00:10:00" = "switch waltz"
"""
TIMELINE = """motion = "walk"
[[commands]]
at = 4.0
say = "tempo 1.5 3"
[[commands]]
at = 6
say = "input speed 1.5"
"""


def drive(path):
    """A rig file, its scales, and the emulated servos of its joints."""
    config = load_rig(path)
    scale, bus = RigScale(config), EmulatedBus(config)
    angles = scale.within(np.zeros(len(config.joints)))
    assert np.isfinite(scale.angles(scale.pulses(angles))).all()
    bus.advance(0.02)


def move(path):
    """A robot file, and a second of its joints within their limits, an approach and a stop."""
    robot = load_robot(path, human())
    envelope = SafetyEnvelope(robot.limits, 0.01)
    envelope.start(robot.rest)
    for tick in range(100):
        assert np.isfinite(envelope(robot.rest + np.sin(0.1 * tick))).all()
    for _ in range(50):
        assert np.isfinite(envelope.brake()).all()
    approach = Approach.within(robot.limits, robot.rest, robot.limits.upper)
    assert np.isfinite(approach.at(0.3)).all()
    if robot.servo is not None:
        assert np.isfinite(robot.motors.line(np.zeros(len(robot.joints)))).all()


def play(path):
    """A library, and some ticks of a deck."""
    deck = Deck(load_library(path), lambda pose: pose.rotation.ravel().copy(), "march")
    for _ in range(20):
        deck.update(0.01)
    assert np.isfinite(deck.pose.rotation).all()


def refusal(read, path):
    """What is said of a file that is refused; "" for one that is taken, and does without a warning what it is for."""
    try:
        with warnings.catch_warnings(action="error"):
            read(path)
    except MotiondeckError as error:
        return str(error)
    return ""


def read_with_one_number_changed(path, read, whole, data, hostile):
    path.write_text(changed(whole, data, hostile))
    for line in refusal(read, path).splitlines():
        assert line.startswith(str(path))
        assert len(line) < LONGEST + len(str(path))


def changed(whole, data, hostile):
    start, end = data.draw(st.sampled_from([match.span() for match in NUMBER.finditer(whole)]))
    return whole[:start] + hostile + whole[end:]


@pytest.fixture
def robots(tmp_path):
    shutil.copy(ROBOTS / "servo20.xml", tmp_path)
    return tmp_path


FILES = {
    "rig": (RIG, drive),
    "recipe": ((shipped_configs() / "libraries" / "thesis15.toml").read_text(), read_recipe),
    "robot": ((ROBOTS / "servo20.toml").read_text(), read_robot_file),
    "show": (SHOW, read_show),
    "stage": (STAGE, read_stage),
    "timeline": (TIMELINE, partial(read_timeline, motions=["walk"])),
}


@pytest.mark.parametrize("kind", FILES)
@given(data=st.data(), hostile=st.sampled_from(HOSTILE))
@settings(max_examples=150)
def test_a_number_of_a_file_is_taken_or_refused_in_lines_that_name_the_file(tmp_path, kind, data, hostile):
    whole, read = FILES[kind]
    read_with_one_number_changed(tmp_path / f"{kind}.toml", read, whole, data, hostile)


@pytest.mark.parametrize(
    ("kind", "wrong", "says"),
    [
        (
            "rig",
            ("zero = 2048", f"zero = {'9' * 400}"),
            "line 12: joints.1.zero is a number of about 400 digits; numbers",
        ),
        ("rig", ("zero = 2048", f"zero = {'9' * 5000}"), "line 12: the number is too long; numbers go up to 1e+15"),
        ("rig", ("gear = 1.0", "gear = 1e-300"), "line 18: joints.1.gear is 1e-300; give 0, or 1e-12 or more"),
        (
            "robot",
            ("[limits]", "root_rotation = [1e308, 0, 0, 0]\n[limits]"),
            ": root_rotation.1 is 1e+308; numbers go",
        ),
        ("show", ("at = 2.0", "at = -inf"), ": cues.1.at is -inf; it must be a finite number"),
        ("timeline", ("at = 6", "at = 1e308"), ": commands.2.at is 1e+308; numbers go from -1e+15 to 1e+15"),
    ],
)
def test_the_line_names_key_and_remedy(tmp_path, kind, wrong, says):
    whole, read = FILES[kind]
    path = tmp_path / f"{kind}.toml"
    path.write_text(whole.replace(*wrong))
    with pytest.raises(MotiondeckError, match=re.escape(says)):
        read(path)


@given(data=st.data(), hostile=st.sampled_from(HOSTILE))
@settings(max_examples=40)
def test_a_number_of_a_robot_file_is_taken_or_refused_in_lines_that_name_the_file(robots, data, hostile):
    whole = (ROBOTS / "servo20.toml").read_text().replace("[limits]", "root_rotation = [1.0, 0.0, 0.0, 0.0]\n[limits]")
    read_with_one_number_changed(robots / "robot.toml", move, whole, data, hostile)


@pytest.mark.parametrize("make", [synthetic.small_library, partial(synthetic.small_phase_library, piece_seconds=0.5)])
def test_a_number_of_a_librarys_header_is_taken_or_refused_in_a_line_that_names_the_file(tmp_path, make):
    save_library(make(), tmp_path / "whole.safetensors")
    with safe_open(tmp_path / "whole.safetensors", framework="numpy") as file:
        arrays, whole = {name: file.get_tensor(name) for name in file.keys()}, file.metadata()["motiondeck"]  # noqa: SIM118

    @given(data=st.data(), hostile=st.sampled_from(HOSTILE))
    def check(data, hostile):
        path = tmp_path / "changed.safetensors"
        save_file(arrays, path, metadata={"motiondeck": changed(whole, data, hostile)})
        said = refusal(play, path)
        assert said.startswith(str(path) if said else "")
        assert "\n" not in said
        assert len(said) < LONGEST + len(str(path))

    check()
