"""The watch of `play --recognize` on a made-up robot with one joint that sticks."""

import numpy as np
import pytest

from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest
from motiondeck.run.recognition.watches import RecognitionWatch, summary_lines
from synthetic import small_library

RATE = 100.0


def bones_as_joints(pose):
    return pose.rotation[1:].ravel()


class Sticking:
    """Is where it is told to be, but for one joint that sticks from some time on; the last joint is not measured."""

    name = "sticking"

    def __init__(self, joints, joint, at):
        self._measured = np.zeros(joints)
        self._joint, self._left = joint, round(at * RATE)

    def write(self, targets, pose):
        self._left -= 1
        kept = self._measured[self._joint]
        self._measured[:] = targets
        if self._left < 0:
            self._measured[self._joint] = kept
        self._measured[-1] = np.nan

    def measured(self):
        self._measured[-1] = np.nan
        return self._measured

    def report(self):
        return {}

    def close(self):
        pass


@pytest.fixture(scope="module")
def library():
    return small_library()


def play(library, at, stop):
    """Plays march on a robot one joint of which sticks at some time."""
    deck = Deck(library, bones_as_joints, "march")
    first, _ = deck.update(0.0)
    moves = np.ptp([deck.update(1.0 / RATE)[0].copy() for _ in range(200)], axis=0)
    deck = Deck(library, bones_as_joints, "march")
    count = len(first)
    joints = [f"j{n}" for n in range(count)]
    big = np.full(count, 1e4)
    limits = JointLimits(-big, big, big, big, big * 1e3)
    channel = Channel(Sticking(count, int(moves[:-1].argmax()), at))
    watch = RecognitionWatch(
        library,
        bones_as_joints,
        joints,
        np.zeros((0, 3), dtype=np.int64),
        limits,
        channel,
        RATE,
        0.5,
        stop=stop,
    )
    request = StopRequest()

    def publish(state):
        watch.update(state, deck, request)

    run(
        deck,
        [channel],
        VirtualClock(RATE),
        SafetyEnvelope(limits, 1.0 / RATE),
        seconds=5.0,
        publish=publish,
        publish_every=1,
    )
    return watch, request, joints[int(moves[:-1].argmax())], joints


def test_a_run_in_which_all_joints_follow_is_recognized_without_alarm(library, capsys):
    watch, request, _, _ = play(library, 1e6, stop=True)
    report = watch.report()
    assert (report["alarms"], report["raised"], report["stopped"], bool(request)) == ([], 0, False, False)
    assert report["right_share"] == 1.0
    assert report["last"]["seen"] == "march"
    assert capsys.readouterr().err == ""
    assert watch.seen is not None
    assert (watch.seen.motion, watch.stuck) == ("march", "")
    assert "100.0 % of the ticks" in summary_lines(report)[0]


@pytest.mark.parametrize("stop", [False, True])
def test_a_joint_that_sticks_is_said_once_and_stops_the_run_if_asked(library, stop, capsys):
    watch, request, joint, _ = play(library, 3.0, stop)
    report = watch.report()
    assert [alarm["joint"] for alarm in report["alarms"]] == [joint]
    assert capsys.readouterr().err.count(f"joint {joint} ") == 1
    assert (bool(request), report["stopped"]) == (stop, stop)
    assert watch.stuck == joint
