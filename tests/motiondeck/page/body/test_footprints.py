"""Feet that stand leave one print each time, where they stood."""

from types import SimpleNamespace

import numpy as np

from motiondeck.page.body.footprints import StepWatch, followed
from sim.models.feet import find_feet
from sim.models.mannequin.mannequin import build_mannequin
from simulated_bodies import human

RATE = 60.0
SQUARE = np.array([[-0.1, -0.05, 0.0], [0.1, -0.05, 0.0], [0.1, 0.05, 0.0], [-0.1, 0.05, 0.0]])


def watched(places):
    """Which feet stand, (T, 2), and the prints of each frame, of two level soles at places (T, 2, 3)."""
    feet = [SimpleNamespace(body=number, corners=SQUARE) for number in range(2)]
    watch, stands, prints = StepWatch(feet, 1.7), [], []
    for at in places:
        data = SimpleNamespace(body=lambda number, at=at: SimpleNamespace(xpos=at[number], xmat=np.eye(3).ravel()))
        prints.append(watch(data, 1.0 / RATE))
        stands.append(watch.stands)
    return np.array(stands), prints


def walk(frames=180, stride=0.5):
    """Places (T, 2, 3) of two feet that take turns to step ahead, each standing for half a second."""
    places = np.empty((frames, 2, 3))
    for foot in range(2):
        for frame in range(frames):
            step, within = divmod(frame + 30 * foot, 60)
            swing = max(within - 30, 0) / 30.0
            places[frame, foot] = [stride * (step + swing), 0.1 - 0.2 * foot, 0.03 + 0.12 * np.sin(np.pi * swing)]
    return places


def test_each_stance_is_one_print_where_the_foot_stood():
    stands, prints = watched(walk())
    assert 0.35 < stands.mean() < 0.6
    assert not stands[:, 0].all()
    found = [(frame, mark) for frame, marks in enumerate(prints) for mark in marks]
    assert [int(mark[0, 1] < 0.0) for _, mark in found] == [0, 1, 0, 1, 0, 1, 0][: len(found)]
    assert len(found) in (6, 7)
    for frame, mark in found:
        foot, middle = int(mark[0, 1] < 0.0), mark.mean(axis=0)
        assert abs(middle[0] / 0.5 - round(middle[0] / 0.5)) < 0.05
        assert 0.0 < middle[2] < 0.02
        assert stands[frame - 5 : frame + 1, foot].all()


def test_a_foot_that_is_lifted_stands_no_more():
    still = np.tile(walk()[:1], (180, 1, 1))
    assert watched(still)[0][1:].all()
    still[50:80, 0, 2] += 0.2
    stands, prints = watched(still)
    assert not stands[50:80, 0].any()
    assert stands[50:80, 1].all()
    assert sum(map(len, prints)) == 3  # one of each foot, and one where it was put down again


def test_soles_go_with_the_body():
    model = build_mannequin(human()).compile()
    feet = find_feet(model, model.qpos0)
    assert {foot.body for foot in feet} == {"rfoo", "lfoo"}
    frames = np.tile(model.qpos0, (12, 1))
    frames[6:, :3] += [1.0, -2.0, 0.5]
    soles, stands, prints = followed(model, frames, feet, RATE)
    np.testing.assert_allclose(soles[6] - soles[5], np.broadcast_to([1.0, -2.0, 0.5], soles[0].shape), atol=1e-12)
    assert abs(soles[0, ..., 2]).max() < 0.1  # it rests with its feet level, and so tilts their soles
    assert stands.shape == (12, 2)
    assert [mark.frame for mark in prints] == sorted(mark.frame for mark in prints)
