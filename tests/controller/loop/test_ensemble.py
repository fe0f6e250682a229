"""Several robots as one: each gets its own joints, and none can move outside its own limits."""

import numpy as np
import pytest

from controller.deck.interfaces import JointLimits
from controller.loop.ensemble import RobotOutput, all_limits, together
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


def test_an_output_gets_and_measures_its_own_joints_only():
    output = Keeping()
    share = RobotOutput(output, first=1, joints=2, of=4, called="second ")
    share.write(np.arange(4.0), POSE)
    assert output.written[0].tolist() == [1.0, 2.0]
    assert share.measured() is None
    output.present = np.array([7.0, 8.0])
    assert np.array_equal(share.measured(), [np.nan, 7.0, 8.0, np.nan], equal_nan=True)
    assert (share.incidents, share.explain) == ((), None)
    output.incidents, output.explain = ["knee was switched off on command"], lambda new: [(new[0], False)]
    assert share.explain(share.incidents) == [(output.incidents[0], False)]
    share.close()
    assert (share.name, share.report(), output.closed) == ("second keeping", {"written": 1}, 1)


def test_what_an_output_raises_reaches_the_loop():
    class Broken(Keeping):
        def write(self, targets, pose):
            raise OSError("the cable is loose")

    with pytest.raises(OSError, match="loose"):
        RobotOutput(Broken(), first=0, joints=1, of=1).write(np.zeros(1), POSE)
