"""Several robots as one: each gets its own joints, and none can move outside its own limits."""

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.loop.ensemble import all_limits, together
from controller.loop.output_channel import Channel
from controller.motion.skeleton import Pose

POSE = Pose(np.zeros(3), np.array(0.0), np.zeros((1, 4)))


class Keeping:
    name = "keeping"

    def __init__(self, present=None):
        self.present, self.written, self.closed = present, [], 0

    def write(self, targets, pose):
        self.written.append(targets.copy())

    def measured(self):
        return self.present

    def report(self):
        return {"written": len(self.written)}

    def close(self):
        self.closed += 1


def limits(joints, reach):
    return JointLimits(*(np.full(joints, x) for x in (-reach, reach, 1.0, 2.0, 3.0)))


def test_the_joints_of_all_stand_one_after_the_other():
    both = together([lambda pose: np.array([1.0, 2.0]), lambda pose: np.array([3.0])])
    assert both(POSE).tolist() == [1.0, 2.0, 3.0]
    assert all_limits([limits(2, 0.5), limits(1, 2.0)]).upper.tolist() == [0.5, 0.5, 2.0]


def test_an_output_gets_measures_and_holds_its_own_joints_only():
    output = Keeping()
    channel = Channel(output)
    channel.share(first=1, joints=2, of=4, prefix="second ")
    channel.write(0, np.arange(4.0), POSE)
    assert output.written[0].tolist() == [1.0, 2.0]
    channel.read(0)
    assert (channel.measured, channel.held, channel.faults) == (None, None, 0)
    output.present, output.held = np.array([7.0, 8.0]), lambda: np.array([0.1, 0.2])
    channel.read(0)
    assert np.array_equal(channel.measured, [np.nan, 7.0, 8.0, np.nan], equal_nan=True)
    assert np.array_equal(channel.held, [np.nan, 0.1, 0.2, np.nan], equal_nan=True)
    assert channel.report() == {"name": "second keeping", "faults": 0, "parked": False, "written": 1}


def test_what_an_output_of_several_raises_is_counted_by_its_name():
    class Broken(Keeping):
        def write(self, targets, pose):
            raise OSError("the cable is loose")

    channel = Channel(Broken())
    channel.share(first=0, joints=1, of=2, prefix="second ")
    channel.write(0, np.zeros(2), POSE)
    assert "the cable is loose" in channel.fault
    assert (channel.report()["name"], channel.faults) == ("second keeping", 1)
