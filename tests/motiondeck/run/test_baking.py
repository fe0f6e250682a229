"""Test that a baked library plays as the library that it was made from, and is only played while both still fit."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from baked_jog import baked_jog, human_library
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.deck.joins.deck_motions import read_motions
from controller.deck.layers import Layers
from controller.library.motion_library import load_library, save_library
from controller.wire.telemetry import StateReader
from motiondeck.cli.main import command_line
from motiondeck.page.network.network_view import InnerLife
from motiondeck.page.web.page_state import PageDescription
from motiondeck.run.baked_libraries import baked_file, find_baked
from motiondeck.run.baking import bake
from motiondeck.run.library_run import library_run
from motiondeck.run.session import Host
from motiondeck.run.spec.program import Program
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.shipped import find_robot
from sim.models.robot_file import read_robot_file
from sim.robots.joint_groups import joint_groups
from sim.robots.robot import RobotLoader

RATE = 200.0


def played(library, robot, ticks=300, layers=()):
    deck, state, found = Deck(library, robot.retarget, "jog"), robot.model.qpos0.copy(), []
    if layers:
        groups = joint_groups(robot, read_robot_file(find_robot("servo20")), library.skeleton)
        deck.layers = Layers(library, robot.joints, robot.limits, groups, robot.twin)
    for tick in range(ticks):
        for at, *layer in layers:
            if at == tick:
                deck.layer(*layer)
        targets, pose = deck.update(1.0 / RATE)
        robot.place(np.clip(targets, robot.limits.lower, robot.limits.upper), pose, state)
        found.append(state.copy())
    return np.array(found)


def test_joints_and_root_go_as_they_are_carried_live():
    loader, human, baked = RobotLoader(find_robot("servo20")), load_library(human_library()), baked_jog()
    live = played(human, loader(human.skeleton, None, 1.0 / RATE))[100:]
    other = played(baked, loader(baked.skeleton, None, 1.0 / RATE))[100:]
    assert np.abs(live[:, 7:] - other[:, 7:]).mean() < 0.05  # rad; legs of a jog are faster than the servos
    ways = [np.linalg.norm(one[-1, :2] - one[0, :2]) for one in (live, other)]
    assert ways[0] > 0.4
    assert ways[1] == pytest.approx(ways[0], rel=0.05)
    assert np.abs(live[:, 2] - other[:, 2]).mean() < 0.01


def test_baked_joints_are_seldom_faster_than_the_robot():
    human, loader = load_library(human_library()), RobotLoader(find_robot("servo20"))
    shares = []
    for library in (human, baked_jog()):
        robot = loader(library.skeleton, None, 1.0 / RATE)
        deck = Deck(library, robot.retarget, "jog")
        targets = np.array([deck.update(1.0 / RATE)[0].copy() for _ in range(300)])
        speed = RATE * np.abs(np.diff(targets, axis=0)) / robot.limits.velocity
        shares.append(np.mean(speed > 1.05))
    assert shares[0] > 0.005
    assert shares[1] < 0.5 * shares[0]


def joint_peaks(angles):
    step = RATE * np.diff(angles, axis=0)
    return np.abs(step).max(), RATE * np.abs(np.diff(step, axis=0)).max()


def test_joins_keep_the_limits_of_the_joints_whatever_the_path_of_the_root_does():
    baked = baked_jog()
    angles = played(baked, RobotLoader(find_robot("servo20"))(baked.skeleton, None, 1.0 / RATE))[:, 7:]
    motion = read_motions(baked)["jog"]
    assert (motion.speed, motion.acceleration) == pytest.approx(joint_peaks(angles), rel=0.1)


def test_layers_leave_other_joints_and_the_root_alone_and_come_and_go_within_the_limits_of_joins():
    baked, loader = baked_jog(), RobotLoader(find_robot("servo20"))
    said = [(20, "arms", "jog", 0.7, 0.5), (300, "head", "jog", 1.0, 2.0), (500, "off", "off")]
    ways = [
        played(baked, loader(baked.skeleton, None, 1.0 / RATE), 700, layers)
        for layers in ((), [(0, "off", "off")], said)
    ]
    robot = loader(baked.skeleton, None, 1.0 / RATE)
    above = robot.layout.hinge_qpos[:8]  # of head and arms
    beside = np.setdiff1d(np.arange(robot.model.nq), above)
    assert np.array_equal(ways[0], ways[1])
    assert np.array_equal(ways[0][:, beside], ways[2][:, beside])
    moved = np.abs(ways[0] - ways[2])[:, above].max(axis=0)
    assert moved.min() > 0.01
    assert (np.divide(joint_peaks(ways[2][:, 7:]), joint_peaks(ways[0][:, 7:])) <= [1.5, 2.0]).all()


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """A library with what is baked of it beside it, and a robot, all of which a test may change."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    library, robot = tmp_path / "jog.safetensors", tmp_path / "servo20.toml"
    shutil.copy(human_library(), library)
    for file in find_robot("servo20").parent.glob("servo20*"):
        shutil.copy(file, tmp_path)
    save_library(baked_jog(), baked_file(library, robot))
    return library, robot


def test_what_is_baked_is_found_and_named_in_a_line(kept, capsys):
    library, file = find_baked(RunSpec(), *kept)
    assert (library.info.baked.robot, file) == ("servo20", baked_file(*kept))
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "played as it was baked for servo20" in said


def test_the_page_looks_into_the_network_that_plays(kept, tmp_path):
    """It compared the neurons of the baked network with those of the human's, and ended."""
    library, robot = kept
    spec = RunSpec(library=str(library), robot=str(robot), command_port=0, seconds=0.1)
    page = SimpleNamespace(state=tmp_path / "state", port=0, process=SimpleNamespace(poll=lambda: None))
    with library_run(spec, Program.of(spec), Host(page=page, clock=VirtualClock(RATE))):
        about = msgspec.convert(StateReader(page.state).description, PageDescription)
    assert (about.library_file, about.network_file) == (str(library), str(baked_file(library, robot)))
    inside = InnerLife.of(Path(about.network_file))
    assert [len(inside.orbits.centre)] == about.shapes["activation"]


@pytest.mark.parametrize("changed", [0, 1])
def test_after_a_change_it_is_carried_live_and_said_in_a_line(kept, changed, capsys):
    file = kept[changed]
    content = file.read_bytes()
    file.write_bytes(content.replace(b"thesis", b"Thesis") if changed == 0 else content + b"\n# changed\n")
    assert find_baked(RunSpec(), *kept) is None
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert ("the library jog", "the robot servo20")[changed] in said
    assert f"library bake {kept[0]} --robot {kept[1]}" in said


@pytest.mark.parametrize("needs", [{"root": "free"}, {"follow": "servo20"}, {"recognize": True}, {"solver": "ik"}])
def test_what_needs_the_human_is_carried_live(kept, needs, capsys):
    assert find_baked(RunSpec(**needs), *kept) is None
    assert capsys.readouterr().err == ""


def test_what_cannot_be_baked_is_refused(tmp_path):
    with pytest.raises(MotiondeckError, match="nothing to bake"):
        bake(human_library(), find_robot("mannequin"))
    file = tmp_path / "baked.safetensors"
    save_library(baked_jog(), file)
    with pytest.raises(MotiondeckError, match="joints already"):
        bake(file, find_robot("servo20"))


def test_a_header_without_the_distances_of_its_motions_is_refused(tmp_path):
    file = tmp_path / "baked.safetensors"
    save_library(baked_jog(), file)
    content = file.read_bytes()
    file.write_bytes(content.replace(rb"\"leaps\":{\"jog\"", rb"\"leaps\":{\"job\""))
    with pytest.raises(FileFormatError, match="how far its motions are apart"):
        load_library(file)


def test_the_command_writes_where_play_looks(kept, monkeypatch, capsys):
    library, robot = kept
    baked_file(library, robot).unlink()
    monkeypatch.setattr("motiondeck.run.baking.bake", lambda *_: baked_jog())
    monkeypatch.setattr("motiondeck.cli.common.verdict_report.verdicts_on", lambda *_: [])
    command_line(["library", "bake", str(library), "--robot", str(robot), "--json"])(
        ["library", "bake", str(library), "--robot", str(robot), "--json"], standalone_mode=False
    )
    said = json.loads(capsys.readouterr().out)
    assert said["written"] == str(baked_file(library, robot))
    assert find_baked(RunSpec(), library, robot) is not None
