"""Watching whether a robot does what it was told."""

import numpy as np
import pytest

from controller.learning.recognition.deck_watch import MOST_ALARMS, DeckWatch, joint_motions, teach_joints
from synthetic import small_library

RATE = 60.0


def bones_as_joints(pose):
    """A made-up robot whose joints are the quaternions of the bones."""
    return pose.rotation[1:].ravel()


@pytest.fixture(scope="module")
def played():
    return joint_motions(small_library(), bones_as_joints, RATE)


@pytest.fixture(scope="module")
def bank():
    return teach_joints(joint_motions(small_library(), bones_as_joints))


def watch_over(bank, patience=0.5):
    channels = bank.readouts.shape[2]
    return DeckWatch(bank, [f"j{n}" for n in range(channels)], RATE, patience)


def show(watch, targets, measured, commanded, seconds=4.0, settled=True, start=0.0):
    """What is raised while loops of targets and measured joints run."""
    alarms = []
    for tick in range(round(seconds * RATE)):
        where = targets[tick % len(targets)], measured[tick % len(measured)]
        alarms += watch.update(*where, commanded, settled=settled, at=start + tick / RATE)
    return alarms


@pytest.mark.parametrize("motion", ["march", "wave"])
def test_what_is_told_and_done_is_seen_without_alarm(bank, played, motion):
    watch = watch_over(bank)
    assert show(watch, played[motion], played[motion], motion) == []
    assert watch.seen == motion
    assert 0.2 < watch.confidence < 1.0
    assert watch.right == 1.0
    assert not watch.stuck.any()


@pytest.mark.parametrize("patience", [0.3, 1.0])
def test_another_motion_than_the_commanded_one_raises_one_alarm_after_the_patience(bank, played, patience):
    watch = watch_over(bank, patience)
    alarms = [alarm for alarm in show(watch, played["wave"], played["wave"], "march") if not alarm.joint]
    assert len(alarms) == 1
    assert (alarms[0].commanded, alarms[0].seen) == ("march", "wave")
    assert 0.65 + patience <= alarms[0].at < 2.0 + patience
    assert "'wave'" in alarms[0].text
    assert watch.mismatch > patience


def test_while_a_switch_is_under_way_nothing_counts(bank, played):
    watch = watch_over(bank)
    assert show(watch, played["wave"], played["wave"], "march", settled=False) == []
    assert watch.right is None


def test_a_joint_that_sticks_is_named_once_and_forgiven_when_it_follows_again(bank, played):
    watch = watch_over(bank)
    march = played["march"]
    joint = int(np.ptp(march, axis=0).argmax())
    stuck = march.copy()
    stuck[:, joint] = march[:, joint].min()
    alarms = [alarm for alarm in show(watch, march, stuck, "march") if alarm.joint]
    assert [alarm.joint for alarm in alarms] == [f"j{joint}"]
    assert watch.stuck[joint]
    show(watch, march, march, "march", seconds=5.0)
    assert not watch.stuck.any()
    assert [a.joint for a in show(watch, march, stuck, "march") if a.joint] == [f"j{joint}"]


def test_a_joint_that_is_not_measured_any_more_is_named(bank, played):
    watch = watch_over(bank)
    gone = played["march"].copy()
    gone[:, 2] = np.nan
    alarms = show(watch, played["march"], gone, "march", seconds=1.0)
    assert [alarm.joint for alarm in alarms] == ["j2"]
    assert "not measured" in alarms[0].text


def test_standing_still_is_nothing_to_be_recognized(bank, played):
    watch = watch_over(bank)
    still = played["wave"][:1]
    assert show(watch, still, still, "march") == []
    assert (watch.seen, watch.confidence) == (None, 0.0)


def test_the_time_until_a_switch_is_seen_counts_from_its_first_tick(bank, played):
    watch = watch_over(bank)
    show(watch, played["march"], played["march"], "march", seconds=2.0)
    assert list(watch.seen_after) == []
    show(watch, played["wave"], played["wave"], "wave", seconds=2.0)
    assert len(watch.seen_after) == 1
    assert 0.0 < watch.seen_after[0] < 1.0


def test_alarms_do_not_pile_up(bank, played):
    watch = watch_over(bank)
    march = played["march"]
    lost = np.full_like(march, np.nan)
    for _ in range(-(-MOST_ALARMS // march.shape[1]) + 1):
        show(watch, march, lost, "march", seconds=0.5)
        show(watch, march, march, "march", seconds=3.5)
    assert watch.raised > MOST_ALARMS
    assert len(watch.alarms) == MOST_ALARMS
