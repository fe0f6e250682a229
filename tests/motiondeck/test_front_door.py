"""The public Python API: what it offers, what it says to mistakes, and that importing it costs nothing."""

import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import motiondeck
import synthetic
from controller.library.motion_library import save_library
from motiondeck import MotiondeckError, UnknownNameError
from motiondeck.libraries import Library
from motiondeck.networks import CentralizedRecipe
from waiting import until

TINY = CentralizedRecipe(satellites=30, iterations=30)


@pytest.fixture(scope="module")
def library():
    return Library(synthetic.small_library())


@pytest.fixture(scope="module")
def file(library, tmp_path_factory):
    path = tmp_path_factory.mktemp("front-door") / "small.safetensors"
    library.save(path)
    return path


def test_every_public_name_is_there_and_no_other():
    for name in motiondeck.__all__:
        assert getattr(motiondeck, name) is not None
    assert dir(motiondeck) == sorted(motiondeck.__all__)
    for name in motiondeck.networks.__all__:
        assert hasattr(motiondeck.networks, name)
    with pytest.raises(AttributeError, match="no attribute 'lern'"):
        motiondeck.lern  # noqa: B018


def test_importing_it_imports_nothing_heavy():
    program = "import sys, motiondeck; print(sorted({'numpy', 'scipy', 'mujoco', 'controller'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_library_is_loaded_without_what_learns_one():
    modules = "print(sorted({'scipy', 'controller.learning'} & set(sys.modules)))"
    program = f"import sys, motiondeck; motiondeck.load_library('thesis15'); motiondeck.Deck; {modules}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_library_is_loaded_by_name_and_by_path(file):
    assert "walk" in motiondeck.load_library("thesis15").motions
    for path in (file, str(file)):
        loaded = motiondeck.load_library(path)
        assert (loaded.name, loaded.motions, loaded.loops) == ("small", ("march", "wave", "bow"), ("march", "wave"))


def test_a_library_that_does_not_exist_is_not_called_damaged(tmp_path):
    with pytest.raises(UnknownNameError, match=r"unknown library 'thesis14'\. Did you mean thesis15"):
        motiondeck.load_library("thesis14")
    for path in (tmp_path / "my.safetensors", str(tmp_path / "my.safetensors"), "my.safetensors"):
        with pytest.raises(MotiondeckError, match="there is no such file"):
            motiondeck.load_library(path)


@pytest.mark.parametrize("motion", ["march", "bow"])
def test_steps_give_what_the_array_holds(library, motion):
    frames = library.generate(motion, seconds=0.5, rate=90.0, tempo=1.3)
    generator = library.generator(motion, tempo=1.3)
    assert frames.shape == (45, 28)
    assert np.array_equal([generator.step(dt) for dt in [0.0] + [1.0 / 90.0] * 44], frames)


def test_a_tempo_changes_how_long_a_motion_takes(library):
    usual = library.generate("march", seconds=1.0, rate=100.0)
    fast = library.generate("march", seconds=0.5, rate=200.0, tempo=2.0)
    turn, forward = 1, 2
    assert fast[:, 0] == pytest.approx(usual[:, 0], abs=1e-6)
    assert fast[:, [turn, forward]] == pytest.approx(2.0 * usual[:, [turn, forward]], abs=1e-6)
    there = library.generate_clip("march", seconds=1.0, rate=100.0).root_position[-1]
    assert library.generate_clip("march", seconds=0.5, rate=200.0, tempo=2.0).root_position[-1] == pytest.approx(there)


def test_half_way_round_is_phase_a_half(library):
    count = synthetic.march().shape[0]
    whole = library.generate("march", seconds=1.0)
    half = library.generate("march", seconds=0.3, phase=0.5)
    assert half[5] == pytest.approx(whole[5 + count // 2], abs=0.05)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"motion": "marhc"}, "Did you mean march"),
        ({"seconds": 0.0}, "at least one frame"),
        ({"seconds": float("nan")}, "at least one frame"),
        ({"rate": -1.0}, "a rate of -1 Hz"),
        ({"rate": 0.0}, "a rate of 0 Hz"),
        ({"tempo": -1.0}, "cannot be played backwards"),
        ({"tempo": float("inf")}, "a tempo of inf"),
        ({"phase": 1.1}, "a phase of 1.1"),
    ],
)
def test_what_cannot_be_generated_is_refused(library, wrong, says):
    with pytest.raises(MotiondeckError, match=says):
        library.generate(**{"motion": "march", "seconds": 1.0} | wrong)


def test_time_goes_forward(library):
    with pytest.raises(MotiondeckError, match="time goes forward"):
        library.generator("march").step(-0.1)


def test_what_was_generated_is_learned_again(library, tmp_path):
    files = []
    for name in ("march", "wave"):
        files.append(tmp_path / f"{name}.bvh")
        motiondeck.save_recording(library.generate_clip(name, seconds=2.0), str(files[-1]))
    files.append(tmp_path / "broken.bvh")
    files[-1].write_text("HIERARCHY")
    learned = motiondeck.learn([str(file) for file in files], name="two", network=TINY, seeds=[0])
    assert learned.motions == ("march", "wave")
    assert learned.failed == {}
    assert list(learned.left_out) == [str(files[-1])]
    learned.save(str(tmp_path / "two.safetensors"))
    assert motiondeck.load_library(tmp_path / "two.safetensors").name == "two"


@pytest.mark.parametrize(
    ("recordings", "says"),
    [
        ([], "nothing was given: no recording found"),
        ("none.bvh", "none.bvh: there is no such file"),
        (["none.bvh"], "none.bvh: there is no such file"),
    ],
)
def test_what_cannot_be_learned_is_refused(recordings, says):
    with pytest.raises(MotiondeckError, match=says):
        motiondeck.learn(recordings, name="mine")


def test_a_clip_is_carried_onto_a_robot_and_saved(tmp_path):
    walk = motiondeck.load_library("thesis15").generate_clip("walk", seconds=0.2, rate=50.0)
    robot = motiondeck.load_robot("servo20")
    motion = robot.retarget(walk)
    assert (motion.joints, motion.angles.shape, motion.root.shape) == (robot.joints, (10, 20), (10, 7))
    assert np.linalg.norm(motion.root[:, 3:], axis=1) == pytest.approx(np.ones(10))
    motion.save(str(tmp_path / "walk.csv"))
    lines = (tmp_path / "walk.csv").read_text().splitlines()
    assert lines[0].split(",")[8:] == list(robot.joints)
    assert [float(word) for word in lines[4].split(",")] == pytest.approx([0.06, *motion.root[3], *motion.angles[3]])
    motion.save(tmp_path / "walk.clip")
    assert motiondeck.read_recording(str(tmp_path / "walk.clip")).skeleton.bones == robot.joints
    with pytest.raises(MotiondeckError, match=r"\.csv or \.clip"):
        motion.save(tmp_path / "walk.txt")


@pytest.mark.parametrize("given", ["walk.bvh", Path("walk.bvh"), None, 3])
def test_what_is_no_clip_is_answered_with_how_to_read_one(given, tmp_path):
    robot = motiondeck.load_robot("servo20")
    for use in (robot.retarget, lambda clip: motiondeck.save_recording(clip, tmp_path / "x.bvh")):
        with pytest.raises(MotiondeckError, match=r"is no clip. Read the recording first: motiondeck.read_recording"):
            use(given)


@pytest.mark.parametrize(
    ("options", "says"),
    [({"unit": "cm"}, "a unit of cm m is not possible"), ({"up": "x"}, "the axis 'x' cannot be up")],
)
def test_an_impossible_unit_or_axis_is_refused(options, says):
    with pytest.raises(MotiondeckError, match=says):
        motiondeck.read_recording("walk.bvh", **options)


def test_recognizers_name_what_does_not_fit(library):
    clip = library.generate_clip("march", seconds=2.0)
    for given, says in (
        ({}, "there is no class; a recognizer needs two"),
        ({"march": clip}, "motion 'march': give a list of its clips"),
        ({"march": ["march.bvh"]}, "'march.bvh' is no clip"),
    ):
        with pytest.raises(MotiondeckError, match=says):
            motiondeck.learn_recognizer(given)
    recognizer = motiondeck.learn_recognizer(
        {name: [library.generate_clip(name, seconds=2.0)] for name in ("march", "wave")}
    )
    with pytest.raises(MotiondeckError, match=r"a frame of shape \(3,\); this recognizer takes \(\d+,\)"):
        recognizer.stream().update([1.0, 2.0, 3.0])


def test_robots_and_solvers_that_do_not_exist_are_named():
    with pytest.raises(UnknownNameError, match="Did you mean servo20"):
        motiondeck.load_robot("servo21")
    with pytest.raises(UnknownNameError, match="unknown solver 'magic'"):
        motiondeck.load_robot("servo20", solver="magic")


def test_clips_and_streams_are_recognized(library, tmp_path):
    def clips(motion):
        return [library.generate_clip(motion, seconds=2.0, tempo=tempo) for tempo in (0.9, 1.0, 1.1)]

    recognizer = motiondeck.learn_recognizer({motion: clips(motion) for motion in ("march", "wave")})
    asked = {motion: library.generate_clip(motion, seconds=2.0, tempo=0.95) for motion in ("march", "wave")}
    assert [recognizer.recognize(clip).motion for clip in asked.values()] == ["march", "wave"]
    recognizer.save(str(tmp_path / "two.safetensors"))
    stream = motiondeck.load_recognizer(str(tmp_path / "two.safetensors")).stream()
    seen, nearest = [], []
    for frame in np.concatenate([recognizer.frames(clip) for clip in asked.values()]):
        seen.append(stream.update(frame))
        nearest.append(stream.nearest)
    assert (nearest[0], set(nearest[1:60]), set(nearest[75:])) == (None, {"march"}, {"wave"})
    assert "march" in seen
    assert 0.0 < stream.confidence < 1.0
    stream.reset()
    assert stream.motion is None


def test_poses_that_come_live_are_recognized(library):
    """At 50 and then at 170 poses a second, one of them broken."""
    clips = {motion: library.generate_clip(motion, seconds=2.0) for motion in ("march", "wave")}
    stream = motiondeck.learn_recognizer({motion: [clip] for motion, clip in clips.items()}).watch(library.skeleton)
    seen = []
    for motion, rate in (("march", 50.0), ("wave", 170.0)):
        live = library.generate_clip(motion, seconds=2.0, rate=rate, tempo=1.1)
        poses = zip(live.root_position, live.rotation, strict=True)
        seen.append([stream.update(root, rotation, 1.0 / rate) for root, rotation in poses])
        assert stream.update(np.full(3, np.nan), live.rotation[0], 0.01) == stream.motion
    assert set(seen[0][25:]) == {"march"}
    assert set(seen[1][100:]) == {"wave"}
    assert 0.0 < stream.confidence < 1.0
    with pytest.raises(MotiondeckError, match=r"shapes \(3,\) and \(9, 4\), not"):
        stream.update(np.zeros(3), np.zeros((4, 4)), 0.01)
    with pytest.raises(MotiondeckError, match="-1 s after"):
        stream.update(np.zeros(3), live.rotation[0], -1.0)


def test_a_simulated_rig_is_moved_without_waiting():
    with motiondeck.open_rig("servo20", servos="simulated") as rig:
        joint, other = rig.joints[3], rig.joints[5]
        rig.move_to({joint: 0.3}, seconds=1.0)
        rig.move_to({other: -0.2}, seconds=1.0)
        angles = dict(zip(rig.joints, rig.read().tolist(), strict=True))
        assert (angles[joint], angles[other]) == pytest.approx((0.3, -0.2), abs=0.01)
        rig.write(np.full(len(rig.joints), 100.0))
        rig.wait(3.0)
        assert rig.read() == pytest.approx(rig.upper, abs=0.02)


@pytest.mark.parametrize(
    ("angles", "says"),
    [({"hed": 0.0}, "unknown joint 'hed'"), ([0.0], "one each"), ([np.nan] * 20, "joint 'head_pan': a target of nan")],
)
def test_targets_that_do_not_fit_a_rig_are_refused(angles, says):
    with motiondeck.open_rig("servo20", servos="simulated") as rig:
        before = rig.read()
        with pytest.raises(MotiondeckError, match=says):
            rig.write(angles)
        assert np.array_equal(rig.read(), before)


@pytest.mark.parametrize("seconds", [-1.0, 0.0, np.nan])
def test_a_movement_takes_some_time(seconds):
    with (
        motiondeck.open_rig("servo20", servos="simulated") as rig,
        pytest.raises(MotiondeckError, match="seconds must be > 0"),
    ):
        rig.move_to({"head_pan": 0.1}, seconds=seconds)


def test_an_emulated_rig_is_read_and_moved_over_its_wire():
    with motiondeck.open_rig("servo20", servos="emulated") as rig:
        joint = rig.joints[3]
        rig.move_to({joint: 0.2}, seconds=0.4)

        def there():
            rig.wait(0.1)
            with suppress(MotiondeckError):  # the servos' process has got no core to answer in
                return dict(zip(rig.joints, rig.read(), strict=True))[joint] == pytest.approx(0.2, abs=0.02)

        until(there, "the joint at its goal")


def test_joints_whose_torque_may_still_be_on_are_named_in_the_end():
    def drive(error=None):
        with motiondeck.open_rig("servo20", servos="simulated") as rig:
            rig._simulated[0].bus.devices[4].dead = True
            if error is not None:
                raise error

    with pytest.raises(MotiondeckError, match="torque may still be on: r_elbow"):
        drive()
    error = ZeroDivisionError()
    with pytest.raises(ZeroDivisionError):
        drive(error)
    assert "torque may still be on" in error.__notes__[0]


def test_rigs_that_do_not_exist_are_named():
    for arguments, says in (
        (("servo2o", "simulated"), "Did you mean servo20"),
        (("servo20", "imagined"), "unknown kind of servos 'imagined'"),
        (("servo20", "real", ("/dev/nowhere",)), "/dev/nowhere"),
    ):
        with pytest.raises(MotiondeckError, match=says), motiondeck.open_rig(*arguments):
            pass


def test_a_library_in_memory_is_saved_as_it_is(library, tmp_path):
    save_library(library.model, tmp_path / "one.safetensors")
    library.save(tmp_path / "other.safetensors")
    assert (tmp_path / "one.safetensors").read_bytes() == (tmp_path / "other.safetensors").read_bytes()


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf")])
def test_a_wait_that_is_no_time_is_refused(seconds):
    with (
        motiondeck.open_rig("servo20", servos="simulated") as rig,
        pytest.raises(MotiondeckError, match="seconds must be >= 0"),
    ):
        rig.wait(seconds)


@pytest.mark.parametrize(
    ("network", "words"),
    [("conceptor", "a recipe such as"), (motiondeck.networks.PhaseRecipe(neurons=-1), "network.neurons is -1")],
)
def test_a_network_that_cannot_be_is_refused_before_recordings_are_read(network, words):
    with pytest.raises(MotiondeckError, match=words):
        motiondeck.learn("nowhere.bvh", name="x", network=network)
