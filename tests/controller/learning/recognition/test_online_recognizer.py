import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.learning.recognition.deck_watch import FollowingWatch, JointWatcher, joint_motions, teach_joints, unwind
from controller.learning.recognition.experts import ExpertRecipe, teach
from controller.learning.recognition.features import ANGLE_UNIT, FeatureRecipe, features
from controller.learning.recognition.online_recognizer import MismatchWatch, OnlineRecognizer
from motiondeck_base.errors import MotiondeckError
from recognition_examples import CLASSES, clip
from synthetic import small_library

LOOK = FeatureRecipe()


@pytest.fixture(scope="module")
def bank():
    parts = [features(clip(name, who, pace), LOOK) for name in CLASSES for who in ("ann", "bob") for pace in (0.9, 1.1)]
    return teach(ExpertRecipe(neurons=50, washout=0), parts, [name for name in CLASSES for _ in range(4)])


def see(online, frames):
    for frame in frames:
        online.update(frame)
    return online


@pytest.fixture(scope="module")
def committee():
    parts = [features(clip(name, who), LOOK) for name in CLASSES for who in ("ann", "bob")]
    return teach(ExpertRecipe(neurons=60, groups=4, washout=0), parts, [name for name in CLASSES for _ in range(2)])


@pytest.mark.parametrize("kind", ["bank", "committee"])
def test_with_a_long_memory_it_says_what_the_whole_clip_says(kind, request):
    bank = request.getfixturevalue(kind)
    frames = features(clip("march", "cem"), LOOK)
    online = see(OnlineRecognizer(bank, 0.0, 30.0, memory=1e6), frames)
    assert np.allclose(online.costs, bank.costs(bank.force([frames]))[0], atol=1e-3)


@pytest.mark.parametrize("motion", CLASSES)
def test_a_motion_is_seen_while_it_happens(bank, motion):
    online = see(OnlineRecognizer(bank, 0.1, 30.0), features(clip(motion, "cem"), LOOK)[:20])
    assert (online.motion, online.known) == (motion, True)
    assert online.behind(motion) == 0.0


def test_it_notices_when_the_motion_changes(bank):
    online = see(OnlineRecognizer(bank, 0.1, 30.0), features(clip("wave", "cem"), LOOK))
    assert online.motion == "wave"
    assert see(online, features(clip("march", "cem"), LOOK)[:30]).motion == "march"
    assert online.behind("wave") > 0.5


def test_before_the_first_foretelling_it_says_nothing(bank):
    online = OnlineRecognizer(bank, 0.0, 30.0)
    assert (online.motion, online.known, online.margin, online.behind("bow")) == (None, False, 0.0, 0.0)
    online.update(np.zeros(online.channels))
    assert online.motion is None


def test_a_gap_is_skipped_and_does_not_last(bank):
    frames = features(clip("march", "cem"), LOOK)
    gap = frames.copy()
    gap[5, 3] = np.nan
    gap[9, 0] = np.inf
    online = see(OnlineRecognizer(bank, 0.1, 30.0), gap)
    assert (online.skipped, online.frames) == (2, len(frames) - 2)
    assert online.motion == "march"
    assert np.isfinite(online.costs).all()


def test_a_memory_that_is_no_time_is_refused(bank):
    with pytest.raises(MotiondeckError, match="memory"):
        OnlineRecognizer(bank, 0.0, 30.0, memory=0.0)


def watch(bank, done, commanded, settled=True, seconds=3.0):
    """When the mismatch watch first raises its voice, or None."""
    online = OnlineRecognizer(bank, 0.1, 30.0)
    watcher = MismatchWatch(online, patience=0.5)
    frames = features(clip(done, "cem"), LOOK)
    for tick in range(round(seconds * 30)):
        online.update(frames[tick % len(frames)])
        if watcher.update(commanded, settled, 1.0 / 30.0):
            return (tick + 1) / 30.0
    return None


def test_the_commanded_motion_raises_no_alarm(bank):
    assert watch(bank, "march", "march") is None
    assert watch(bank, "wave", "wave") is None


def test_another_motion_does_after_grace_and_patience(bank):
    after = watch(bank, "march", "wave")
    assert after is not None
    assert after >= 1.2


def test_no_alarm_while_switching_or_for_motions_that_are_not_known(bank):
    assert watch(bank, "march", "wave", settled=False) is None
    assert watch(bank, "march", "somersault") is None


# --- the joints of a robot ---


def bones_as_joints(pose):
    """A made-up robot whose joints are the quaternions of the bones."""
    return pose.rotation[1:].ravel()


@pytest.fixture(scope="module")
def joints():
    return joint_motions(small_library(), bones_as_joints)


def test_a_library_teaches_what_its_own_robot_does(joints):
    bank = teach_joints(joints)
    for motion, frames in joints.items():
        watcher = JointWatcher(bank)
        for frame in frames[:40]:
            watcher.update(frame, 1.0 / 30.0)
        assert watcher.recognizer.motion == motion


def test_a_library_of_one_motion_is_refused(joints):
    with pytest.raises(MotiondeckError, match="one motion"):
        teach_joints({"march": joints["march"]})


@pytest.fixture(scope="module")
def taught(joints):
    return teach_joints(joints)


@given(st.lists(st.floats(0.002, 0.09), min_size=5, max_size=60))
def test_at_any_pace_of_measuring_the_recognizer_gets_its_own(taught, steps):
    watcher = JointWatcher(taught)
    taken = []
    watcher.recognizer.update = lambda frame: taken.append(frame.copy() * ANGLE_UNIT)
    joints_count = watcher.recognizer.channels
    time = 0.0
    watcher.update(np.full(joints_count, time), 0.0)
    for step in steps:
        time += step
        watcher.update(np.full(joints_count, time), step)
    assert np.allclose([frame[0] for frame in taken], np.arange(len(taken)) / 30.0, atol=1e-9)
    assert len(taken) == int(time * 30.0 + 1e-6) + 1


def test_a_measurement_that_is_missing_is_left_out(joints):
    watcher = JointWatcher(teach_joints(joints))
    watcher.update(np.zeros(watcher.recognizer.channels), 0.0)
    watcher.update(np.full(watcher.recognizer.channels, np.nan), 0.1)
    assert (watcher.recognizer.frames, watcher.recognizer.skipped) == (1, 1)


@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3), st.integers(-2, 2))
def test_a_ball_joint_looks_the_same_whole_turns_further(vector, turns):
    angle = float(np.linalg.norm(vector))
    axis = np.array(vector) / angle if angle > 1e-6 else np.array([0.0, 0.0, 1.0])
    balls = np.array([[1, 2, 3]])
    joints = np.array([0.7, *(angle * axis)]), np.array([0.7, *((angle + 2.0 * np.pi * turns) * axis)])
    for one in joints:
        unwind(one, balls)
    assert np.allclose(joints[0], [0.7, *(np.sin(angle) * axis)], atol=1e-9)
    assert np.allclose(*joints, atol=1e-9)


# --- following ---


def follow(measure, seconds=4.0, rate=100.0):
    """Which of two joints are ever said not to follow, and when first (s)."""
    watch = FollowingWatch(2, rate)
    first: list[float | None] = [None, None]
    for tick in range(round(seconds * rate)):
        t = tick / rate
        stuck = watch.update(np.array([np.sin(2 * t), 0.1]), measure(t))
        for joint in np.flatnonzero(stuck):
            first[joint] = t if first[joint] is None else first[joint]
    return first


@pytest.mark.thorough
@given(st.floats(0.0, 0.2), st.floats(0.0, 0.05))
def test_a_joint_that_comes_late_and_trembles_follows(delay, noise):
    rng = np.random.default_rng(0)
    assert follow(lambda t: np.array([np.sin(2 * max(t - delay, 0.0)), 0.1]) + noise * rng.normal()) == [None, None]


@pytest.mark.thorough
@given(st.floats(-1.0, 1.0))
def test_a_jammed_joint_is_found_wherever_it_sticks(where):
    first = follow(lambda t: np.array([np.sin(2 * t) if t < 1.0 else where, 0.1]))
    assert first[1] is None
    assert first[0] is not None
    assert 1.0 < first[0] < 3.0


def test_a_joint_that_sticks_while_it_should_be_elsewhere_for_a_third_of_a_second_is_found():
    watch = FollowingWatch(1, 100.0)
    told = np.where((np.arange(300) >= 100) & (np.arange(300) < 135), 0.2, 0.0)
    found = [watch.update(np.array([target]), np.zeros(1))[0] for target in told]
    assert np.flatnonzero(found).min() in range(125, 140)


def test_a_joint_that_does_not_answer_does_not_follow():
    first = follow(lambda t: np.array([np.sin(2 * t), np.nan]))
    assert first[0] is None
    assert first[1] is not None
    assert first[1] < 0.5


def test_following_refuses_what_cannot_be_watched():
    with pytest.raises(MotiondeckError):
        FollowingWatch(0, 100.0)
    with pytest.raises(MotiondeckError):
        FollowingWatch(3, 1.0)
