"""Motions that were carried to a robot are read back from every format, learned, and played on that robot."""

import joblib
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import motiondeck
from controller.motion.clip import Clip, poses_of
from controller.motion.formats.reading import recordings_below
from controller.motion.formats.writing import write_clip
from sim.robots.retarget_files import retarget_files
from sim.robots.robot import load_robot
from simulated_bodies import human, smooth_poses
from small_robots import SERVOS, calibrated, humanoid

LID = '<body name="lid" pos="0 0 0.3"><joint name="lid" axis="0 1 0"/><geom size="0.02"/></body>'
FOLLOWS = '<equality><joint joint1="lid" joint2="left_knee" polycoef="0.1 -0.5 0 0 0"/></equality>'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A robot with a joint that follows another one, and a recording."""
    folder = tmp_path_factory.mktemp("round trip")
    (folder / "small.xml").write_text(humanoid(trunk=LID, extra=FOLLOWS, servos=[*SERVOS, "lid"]))
    (folder / "small.toml").write_text(calibrated(folder / "small.xml").to_toml(folder))
    poses = smooth_poses(human(), np.random.default_rng(3), 150, reach=0.3, step=0.02)
    turns = np.array([pose.rotation for pose in poses])
    write_clip(Clip("swing", human(), 60.0, np.tile([0.0, 0.0, 0.95], (150, 1)), turns), folder / "swing.bvh")
    return folder


def angles_in(path):
    """Angles (T, J) of all joints of the model, and the rate, by numpy alone."""
    if path.suffix == ".csv":
        return np.loadtxt(path, delimiter=",")[:, 7:], 30.0
    arrays = np.load(path)
    return arrays["joint_pos"] if "joint_pos" in arrays else arrays["qpos"][:, 7:], float(np.ravel(arrays["fps"])[0])


@pytest.mark.parametrize("format", ["csv", "npz", "mjlab", "qpos"])
def test_joint_angles_come_back_within_half_a_degree(folder, format):
    out = folder / format
    with joblib.parallel_config(backend="threading"):
        rows = list(retarget_files(folder / "small.toml", [folder / "swing.bvh"], out, format))
    assert rows[0].error is None
    recorded = recordings_below(out)
    assert len(recorded) == 1
    library = motiondeck.learn(recorded, name=format)
    assert not library.failed
    truth, rate = angles_in(recorded[0])
    clip = library.generate_clip(library.motions[0], seconds=len(truth) / rate + 1.0, rate=120.0)
    robot = load_robot(folder / "small.toml", clip.skeleton)
    played = np.array([robot.retarget(pose).copy() for pose in poses_of(clip)])
    names = (out / "joints.txt").read_text().split("\n")
    assert "# lid" in names
    recorded_angles = truth[:, [names.index(joint) for joint in robot.joints]]
    curve = CubicSpline(np.arange(len(played)) / 120.0, played)
    times = np.arange(len(truth)) / rate
    end = (
        np.floor(120.0 * times[-1] + 1e-6) / 120.0
    )  # of the motion at 120 Hz, at most a frame of that before the file's
    inside = times < end + 1e-6
    off = np.abs(curve(played_at(times[inside], end)) - recorded_angles[inside])
    assert np.degrees(off).max() < 0.5
    held = CubicSpline(times, recorded_angles)(end)
    assert np.degrees(np.abs(played[-1] - held)).max() < 0.5


def played_at(times, end):
    """When a one-shot plays the moments of its recording, s: its last 0.2 s take twice as long, slower and slower."""
    share = np.linspace(0.0, 1.0, 1001)
    ways = end - 0.2 + 0.4 * (share - share**3 + 0.5 * share**4)
    return np.where(times < ways[0], times, np.interp(times, ways, end - 0.2 + 0.4 * share))
