"""The worst join of a library: what is told, beside a deck that is measured otherwise and beside all other joins."""

import numpy as np
import pytest

from controller.deck.deck import Deck
from controller.deck.joins.deck_motions import read_motions
from controller.deck.worst_join import RATE, Join, MeasuredDeck, hardest_joins, play_join, worst_join
from controller.library.motion_library import load_library
from motiondeck.cli.common.library_report import join_fields, join_line
from motiondeck_base.shipped import shipped_configs


@pytest.fixture(scope="module")
def library():
    return load_library(shipped_configs() / "libraries" / "thesis15.safetensors")


def test_a_join_is_as_fast_as_its_poses_say(library):
    """The same switch, its root and joints written down and differentiated by numpy's gradient."""
    found = play_join(library, "walk", "jog", 0.3)
    dt, places = 1.0 / 200.0, []
    deck = Deck(library, lambda pose: pose.root_position, "walk", phase=0.3)
    for tick in range(13 + round(found.seconds / dt)):
        if tick == 3:
            deck.switch("jog")
        pose = deck.update(dt)[1]
        places.append(library.skeleton.joints(pose.root_position, pose.rotation))
    places = np.array(places)
    motions = [read_motions(library)[name] for name in ("walk", "jog")]
    own = max(motion.speed for motion in motions), max(motion.acceleration for motion in motions)
    velocity = np.gradient(places, dt, axis=0)
    assert found.speed == pytest.approx(np.linalg.norm(velocity, axis=-1).max() / own[0], rel=0.03)
    bent = (places[2:] - 2.0 * places[1:-1] + places[:-2]) / dt**2
    assert found.acceleration == pytest.approx(np.linalg.norm(bent, axis=-1).max() / own[1], rel=1e-6)


@pytest.mark.parametrize("motion", ["walk", "cartwheel", "standup"])
def test_joins_are_measured_against_no_more_than_a_motion_does_by_itself(library, motion):
    alone = MeasuredDeck(library, motion, direct=True)
    alone.play(2 * round(read_motions(library)[motion].seconds * RATE))
    speed, acceleration = alone.peaks([motion])
    assert speed == pytest.approx(1.0, abs=0.01)
    assert acceleration == pytest.approx(1.0, abs=0.05)


def test_the_joins_that_look_hardest_are_those_of_bodies_far_apart(library):
    hardest = hardest_joins(library, 300)
    pairs = [pair[:2] for pair in hardest]
    assert len(set(pairs)) == len(pairs)
    assert ("walk", "walk") not in pairs
    assert ("crawl", "waltz") not in pairs, "goes by way of standup"
    place = pairs.index
    assert place(("standup", "waltz")) < place(("walk", "slow-walk"))


def test_the_worst_that_is_told_is_the_worst_of_those_played(library):
    found = worst_join(library, played=3)
    joins = [play_join(library, *one) for one in hardest_joins(library, 3)]
    assert found is not None
    assert found == max(joins, key=lambda join: join.use)
    assert found.passes


def test_a_join_beyond_the_limits_is_called_too_fast():
    within, beyond = Join("a", "b", 0.25, 1.5, 2.0, 0.4), Join("a", "b", 0.25, 1.0, 2.02, 0.4)
    assert (within.use, beyond.use) == (pytest.approx(1.0), pytest.approx(1.01))
    assert "too fast" not in join_line(within)
    assert join_line(beyond).endswith("too fast, so a robot may lag there")
    fields = join_fields(beyond)
    assert fields is not None
    assert fields["passes"] is False
    assert join_fields(None) is None
