import numpy as np

from controller.motion.skeleton import Pose
from motiondeck.run.page.page import LatePoses


def test_the_human_is_shown_as_the_body_is_that_follows_it():
    late = LatePoses(1.2)
    place, turn = np.zeros(3), np.zeros((2, 4))
    shown = []
    for k in range(200):
        place[0] = turn[0, 0] = 0.02 * k  # the loop writes each tick into the same arrays
        shown.append(late.pose(0.02 * k, Pose(place, np.array(0.0), turn, offsets=np.full((1, 3), 0.02 * k))))
    for k in (0, 30, 60, 61, 150, 199):
        root, late_turn, offsets = shown[k].root_position, shown[k].rotation, shown[k].offsets
        assert root[0] == late_turn[0, 0] == offsets[0, 0]
        assert abs(root[0] - max(0.02 * k - 1.2, 0.0)) < 0.021


def test_a_body_that_follows_at_once_has_its_human_at_once():
    late = LatePoses(0.0)
    for k in range(5):
        pose = late.pose(0.02 * k, Pose(np.full(3, float(k)), np.array(0.0), np.zeros((2, 4))))
        assert pose.root_position[0] == k
