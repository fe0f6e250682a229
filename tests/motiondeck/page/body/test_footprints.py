"""Feet that stand leave one print each time, where they stood."""

import mujoco
import numpy as np

from motiondeck.page.body.footprints import footprints, soles, standing
from sim.models.feet import find_feet
from sim.models.mannequin.mannequin import build_mannequin
from simulated_bodies import human

RATE = 60.0


def walk(frames=180, stride=0.5):
    """Corners (T, 2, 4, 3) of two feet that take turns to step ahead, each standing for half a second."""
    square = np.array([[-0.1, -0.05, 0.0], [0.1, -0.05, 0.0], [0.1, 0.05, 0.0], [-0.1, 0.05, 0.0]])
    corners = np.empty((frames, 2, 4, 3))
    for foot in range(2):
        for frame in range(frames):
            step, within = divmod(frame + 30 * foot, 60)
            swing = max(within - 30, 0) / 30.0
            at = [stride * (step + swing), 0.1 - 0.2 * foot, 0.03 + 0.12 * np.sin(np.pi * swing)]
            corners[frame, foot] = square + at
    return corners


def test_each_stance_is_one_print_where_the_foot_stood():
    corners = walk()
    stands = standing(corners, RATE, 1.7)
    assert 0.4 < stands.mean() < 0.6
    assert not stands[:, 0].all()
    model = build_mannequin(human()).compile()
    prints = footprints(model, corners, stands)
    assert [mark.foot for mark in prints] == [0, 1, 0, 1, 0, 1, 0][: len(prints)]
    assert len(prints) in (6, 7)
    for mark in prints:
        middle = mark.corners.mean(axis=0)
        assert abs(middle[0] / 0.5 - round(middle[0] / 0.5)) < 0.05
        assert 0.0 < middle[2] < 0.02
        assert stands[mark.first : mark.last + 1, mark.foot].all()


def test_a_tremble_is_no_step():
    corners = walk()
    still = corners.copy()
    still[:] = corners[:1]
    still[50:53, 0, :, 2] += 0.2
    stands = standing(still, RATE, 1.7)
    assert stands.all()
    still[50:80, 0, :, 2] += 0.2
    assert not standing(still, RATE, 1.7)[60:70, 0].any()


def test_soles_go_with_the_body():
    model = build_mannequin(human()).compile()
    feet = find_feet(model, model.qpos0)
    assert {foot.body for foot in feet} == {"rfoo", "lfoo"}
    frames = np.tile(model.qpos0, (2, 1))
    frames[1, :3] += [1.0, -2.0, 0.5]
    corners = soles(model, frames, feet)
    np.testing.assert_allclose(corners[1] - corners[0], np.broadcast_to([1.0, -2.0, 0.5], corners[0].shape), atol=1e-12)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert abs(corners[0, ..., 2]).max() < 0.1  # it rests with its feet level, and so tilts their soles
