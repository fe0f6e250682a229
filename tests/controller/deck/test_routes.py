from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import synthetic
from controller.deck.deck import Deck
from controller.deck.joins.deck_motions import Motion, read_motions
from controller.deck.routes import LEAP_M, Routes
from controller.library.motion_library import load_library
from controller.motion.skeleton import Posture
from motiondeck_base.shipped import shipped_configs

DT = 0.01


def motion(name, start, end, *, loop):
    """A motion whose root goes from one height to another, with one joint at the root."""
    places = np.zeros((10, 4))
    places[:, 3] = np.linspace(start, end, 10)
    exits = places if loop else places[-1:]
    upright = Posture(places[:, 3], np.zeros((10, 2)), np.zeros(10), np.tile([1.0, 0.0, 0.0, 0.0], (10, 2, 1)))
    course = np.zeros((10, 7))
    return Motion(
        name, loop, places[:1], np.zeros((1, 4)), exits, course, upright, np.zeros((1, 3)), 0.1, 1.0, 1.0, 1.0, 1.0
    )


def repertoire(*motions):
    return {motion.name: motion for motion in motions}


STAND, CROUCH, LIE = 1.0, 0.6, 0.1
BODY = repertoire(
    motion("stand", STAND, STAND, loop=True),
    motion("crouch", CROUCH, CROUCH, loop=True),
    motion("lie", LIE, LIE, loop=True),
    motion("get-up", LIE, STAND, loop=False),
    motion("lie-down", STAND, LIE, loop=False),
)


@pytest.mark.parametrize(
    ("start", "goal", "way"),
    [
        ("lie", "stand", ("get-up",)),
        ("stand", "lie", ("lie-down",)),
        ("lie-down", "stand", ("get-up",)),
        ("get-up", "get-up", ("lie-down",)),
        ("stand", "stand", ()),
        ("stand", "lie-down", ()),
        ("stand", "get-up", ("lie-down",)),
        ("stand", "crouch", ()),
    ],
)
def test_a_far_motion_is_reached_by_what_leads_there(start, goal, way):
    assert Routes.between(BODY).way(start, goal) == way


@pytest.mark.parametrize(
    ("motions", "why"),
    [
        (["stand", "crouch"], ""),
        (["stand", "get-up"], "get-up is a one-shot"),
        (["stand", "crouch", "lie"], "stand and lie are too far apart to be blended: lie-down lies between"),
        (["crouch", "stand", "lie"], "crouch and lie"),
    ],
)
def test_what_cannot_play_side_by_side_is_not_blended(motions, why):
    routes = Routes.between(BODY)
    assert routes.blend_obstacle(motions).startswith(why)
    assert bool(routes.blend_obstacle(motions)) == bool(why)
    assert bool(routes.direct.blend_obstacle(motions)) == ("one-shot" in why)


def test_loops_are_never_gone_by():
    loops = repertoire(*(motion(str(h), h, h, loop=True) for h in (0.1, 0.5, 0.9)))
    assert Routes.between(loops).way("0.1", "0.9") == ()


def test_a_leap_is_the_difference_in_height():
    assert Routes.between(BODY).leaps["lie"]["stand"] == pytest.approx(STAND - LIE)
    assert Routes.between(BODY).leaps["get-up"]["stand"] == pytest.approx(0.0, abs=1e-6)


def test_between_near_motions_the_way_is_direct():
    assert Routes.between(read_motions(synthetic.small_library())).way("march", "wave") == ()


@pytest.fixture(scope="module")
def shipped():
    return load_library(shipped_configs() / "libraries" / "thesis15.safetensors")


@pytest.mark.parametrize(
    ("start", "goal", "way"),
    [
        ("crawl", "waltz", ("standup",)),
        ("walk", "sitting", ("getseated",)),
        ("sitting", "crawl", ("stool-standup", "getdown")),
        ("walk", "jog", ()),
        ("waltz", "box1", ()),
        ("cartwheel", "walk", ()),
    ],
)
def test_the_shipped_motions_are_joined_as_people_would(shipped, start, goal, way):
    assert Routes.between(read_motions(shipped)).way(start, goal) == way


def test_from_crawl_to_waltz_the_body_stands_up_first(shipped):
    deck = Deck(shipped, lambda pose: pose.rotation, "crawl")
    for _ in range(50):
        deck.update(DT)
    switch = deck.switch("waltz")
    assert switch.via == ("standup",)
    changes, played = 0, deck.playing
    while switch.settled_s is None:
        deck.update(DT)
        if deck.playing != played:
            changes, played = changes + 1, deck.playing
            assert played == ("standup", "waltz")[changes - 1]
            if played == "waltz":
                assert deck.pose.root_position[2] > 0.8
        assert deck.time < 15.0
    assert switch.first_change_s is not None
    assert switch.first_change_s - switch.commanded_s <= 2.01 * DT


@given(st.integers(0, 10_000))
def test_no_other_way_is_cheaper(seed):
    names, rng = ("a", "b", "c", "d", "e"), np.random.default_rng(seed)
    leaps = {one: {other: float(rng.uniform(0.0, 0.6)) for other in names} for one in names}
    bridges = {name for name in names if rng.uniform() < 0.8}

    def cost(way):
        return sum((leaps[one][other] / LEAP_M) ** 2 + 1.0 for one, other in pairwise(("a", *way, "b")))

    others = sorted(bridges - {"a", "b"})
    ways = [way for count in range(len(others) + 1) for way in permutations(others, count)]
    assert cost(Routes(leaps, frozenset(bridges)).way("a", "b")) == pytest.approx(min(map(cost, ways)))
