"""The example rigs: what is written for them keeps to their limits, is learned, and moves emulated servos."""

import json
from pathlib import Path

import numpy as np
import pytest

from command_line import motiondeck
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.reading import read_clip
from controller.wire.run_recording import load_recording
from hardware.rig.rig_file import load_rig
from hardware.tools.teaching import beyond_limits

EXAMPLES = Path(__file__).parents[2] / "examples"
RIGS = {
    "head": (8, "idle look nod talk wink", "look"),
    "arm": (6, "pick wave", "wave"),
    "hexapod": (18, "tripod", "tripod"),
}


def motions(name):
    return [file for file in sorted((EXAMPLES / name).glob("*.toml")) if file.stem != name]


def course(file, rig):
    """The angles (T, J) of a file in the order of a rig's joints, rad, and its rate."""
    clip = read_clip(file)
    angles = angles_of(clip.rotation[:, 1:])
    return angles[:, [clip.skeleton.bones.index(joint) for joint in rig.names]], clip.rate


@pytest.mark.parametrize("name", RIGS)
def test_what_is_written_keeps_to_the_limits_of_the_rig(name):
    rig = load_rig(EXAMPLES / name / f"{name}.toml")
    joints, names, _ = RIGS[name]
    assert len(rig.joints) == joints
    assert [file.stem for file in motions(name)] == names.split()
    for file in motions(name):
        angles, rate = course(file, rig)
        assert beyond_limits(rig, angles, rate) == [], file.stem
        bounds = [joint.acceleration or 80.0 for joint in rig.joints]
        assert (np.abs(np.diff(angles, n=2, axis=0)).max(axis=0) * rate**2 < bounds).all(), file.stem


def test_three_legs_of_the_hexapod_stand_while_the_other_three_swing():
    rig = load_rig(EXAMPLES / "hexapod" / "hexapod.toml")
    angles, _ = course(EXAMPLES / "hexapod" / "tripod.toml", rig)
    coxa, femur = angles[:, 0::3], angles[:, 1::3]
    lifted, ahead = femur > 1e-6, np.gradient(coxa, axis=0) > 1e-6
    assert (lifted.sum(axis=1) <= 3).all()
    assert lifted.any(axis=0).all()
    assert not (ahead[1:-1] & ~lifted[1:-1]).any()  # no foot is pushed forwards over the ground
    for leg in range(3):  # the legs of the other side are half a round later
        other = np.roll(femur[:-1, 3 + leg], len(femur) // 2)
        assert other == pytest.approx(femur[:-1, leg], abs=1e-6)


@pytest.mark.thorough
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", RIGS)
def test_it_is_learned_and_emulated_servos_go_where_it_was_written(name, tmp_path):
    rig, first = load_rig(EXAMPLES / name / f"{name}.toml"), RIGS[name][2]
    library, record = tmp_path / f"{name}-motions.safetensors", tmp_path / "run.rec"
    said = motiondeck("learn", *motions(name), "--out", library, "--json")
    assert said.returncode == 0, said.stderr
    assert all(motion["passed"] for motion in json.loads(said.stdout)["motions"])
    wanted, rate = course(EXAMPLES / name / f"{first}.toml", rig)
    seconds = f"{1.5 * len(wanted) / rate:.1f}"
    file = f"emulated:{EXAMPLES / name / f'{name}.toml'}"
    words = ("play", first, "--library", library, "--rig", file, "--headless", "--command-port", "0")
    played = motiondeck(*words, "--seconds", seconds, "--record", record)
    assert played.returncode == 0, played.stderr
    run = load_recording(record)
    assert tuple(run.description["joints"]) == rig.names
    playing = run.fields["approaching"][:, 0] == 0.0
    targets, measured = (run.fields[name][playing] for name in ("targets", "measured"))
    far = np.ptp(wanted, axis=0) > 0.1
    assert far.any()
    assert targets.max(axis=0) == pytest.approx(wanted.max(axis=0), abs=0.03)
    assert targets.min(axis=0) == pytest.approx(wanted.min(axis=0), abs=0.03)
    # Shafts come late, and on a busy machine they overshoot.
    assert (np.nanmax(measured, axis=0) - np.nanmin(measured, axis=0) > 0.7 * np.ptp(wanted, axis=0))[far].all()
    # The recorded run is a motion itself.
    assert motiondeck("clip", "convert", record, tmp_path / "run.clip").returncode == 0
    assert read_clip(tmp_path / "run.clip").skeleton.bones == rig.names
