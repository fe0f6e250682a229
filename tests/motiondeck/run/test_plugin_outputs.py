"""Outputs of other packages, found by their entry points: a tiny installed package in a folder of the test."""

from contextlib import ExitStack

import numpy as np
import pytest

import synthetic
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.loop.output_channel import FAULTS_TO_PARK
from controller.motion.skeleton import Pose
from motiondeck.run.assembly import open_session
from motiondeck.run.plugin_outputs import PluggedOutput, open_outputs
from motiondeck.run.robots.robot_on_deck import open_robots
from motiondeck.run.session import Host, Played
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError, UnknownNameError

POSE = Pose(np.zeros(3), np.zeros(()), np.array([[1.0, 0.0, 0.0, 0.0]]))
PLUGIN = """
from pathlib import Path

class LogOutput:
    def __init__(self, joints, rate, argument):
        self.file = Path(argument).open("w")
        print(*joints, rate, file=self.file)

    def write(self, targets, pose):
        print(*targets, file=self.file)

    def close(self):
        print("closed", file=self.file)
        self.file.close()

class Broken:
    def __init__(self, **options):
        raise OSError("no such device")

def measuring(joints, rate, argument):
    return Measuring()

class Measuring:
    def write(self, targets, pose):
        raise RuntimeError("unplugged")

    def measured(self):
        return [1.0]

    def report(self):
        return {"faults": 2}

    def close(self):
        raise RuntimeError("unplugged")
"""
ENTRY_POINTS = """[motiondeck.outputs]
log = plugin_package:LogOutput
broken = plugin_package:Broken
measuring = plugin_package:measuring
missing = no_such_package:Output
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A folder on the path with a package that provides outputs."""
    (tmp_path / "plugin_package.py").write_text(PLUGIN)
    info = tmp_path / "plugin_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: plugin-package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_an_output_gets_its_argument_every_target_and_is_closed_once(installed):
    file = installed / "targets.txt"
    with ExitStack() as opening:
        (channel,) = open_outputs(opening, [f"log:{file}"], ["a", "b"], 100.0)
        for tick in range(3):
            channel.read(tick)
            channel.write(tick, np.array([tick, 0.5]), POSE)
        assert channel.report() == {"name": "log", "faults": 0, "parked": False, "kind": "plugin"}
        channel.output.close()
    lines = ["a b 100.0", "0.0 0.5", "1.0 0.5", "2.0 0.5", "closed"]
    assert file.read_text().splitlines() == lines


@pytest.mark.parametrize(
    ("spec", "kind", "says"),
    [
        ("lgo", UnknownNameError, "Did you mean log"),
        (
            "broken",
            MotiondeckError,
            r"'broken' \(plugin_package:Broken\) cannot be opened: OSError: no such device",
        ),
        ("missing", MotiondeckError, "cannot be opened: ModuleNotFoundError"),
    ],
)
def test_an_output_that_cannot_be_opened_is_refused_by_name(installed, spec, kind, says):
    with ExitStack() as opening, pytest.raises(kind, match=says):
        open_outputs(opening, [spec], ["a"], 100.0)


def test_one_that_raises_is_parked_and_closing_it_disturbs_no_other(installed, capsys):
    with ExitStack() as opening:
        (channel,) = open_outputs(opening, ["measuring"], ["a"], 100.0)
        for tick in range(FAULTS_TO_PARK):
            channel.read(tick)
            assert channel.measured == [1.0]
            channel.write(tick, np.zeros(1), POSE)
        assert channel.parked
        assert channel.report()["faults"] == FAULTS_TO_PARK + 2
    assert "output measuring was not closed: RuntimeError: unplugged" in capsys.readouterr().err


def test_a_run_writes_every_tick_to_it(installed):
    library, file = synthetic.small_library(), installed / "run.txt"
    spec = RunSpec(physics=False, rate=50.0, seconds=0.5, outputs=(f"log:{file}", "measuring"))
    played = Played(
        library, lambda opening: open_robots(opening, spec, library), lambda retarget: Deck(library, retarget, "march")
    )
    with open_session(spec, played, Host(clock=VirtualClock(50.0))) as run:
        report = run.run()
    head, *lines, end = file.read_text().splitlines()
    assert head.split() == [*run.robots[0].joints, "50.0"]
    assert (len(lines), end) == (report["ticks"], "closed")
    assert [output["name"] for output in report["outputs"]] == ["kinematics", "log", "measuring"]
    assert [output["parked"] for output in report["outputs"]] == [False, False, True]
    assert report["outputs"][2]["fault"] == "RuntimeError: unplugged"


def test_a_late_write_is_a_fault():
    class Slow:
        seconds = 0.0

        def write(self, targets, pose):
            self.seconds += 0.006

        def close(self):
            pass

    slow = Slow()
    output = PluggedOutput("slow", slow, 1, 100.0, now=lambda: slow.seconds)
    with pytest.raises(MotiondeckError, match=r"took 6\.0 ms, more than 5\.0 ms"):
        output.write(np.zeros(1), POSE)
    PluggedOutput("slow", slow, 1, 50.0, now=lambda: slow.seconds).write(np.zeros(1), POSE)


def test_an_output_may_lag_and_says_so_in_seconds():
    class Late:
        lag = (0.03, 0.0)

        def write(self, targets, pose):
            pass

    assert PluggedOutput("late", Late(), 2, 100.0).lag.tolist() == [0.03, 0.0]
    for joints, wrong in ((3, (0.03, 0.0)), (2, (-0.01, 0.0)), (2, (0.6, 0.0)), (2, (float("nan"), 0.0))):
        Late.lag = wrong
        with pytest.raises(MotiondeckError, match="output late: its lag must be"):
            PluggedOutput("late", Late(), joints, 100.0)
