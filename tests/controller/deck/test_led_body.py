"""A person's whole body is told from six points, and the deck's body goes to it, and back, without a jolt."""

from functools import partial

import numpy as np
import pytest

import synthetic
from controller.deck.deck import Deck
from controller.deck.locks.led_body import LedBody
from controller.deck.person_body import PersonBody, body_rows
from controller.deck.person_follower import PersonFollower, body_course
from controller.learning.reservoirs.completion_training import CompletionRecipe, learn_completion
from controller.motion.rotations import between, conjugate, from_rotation_vector, multiply, rotate, yaw
from controller.motion.skeleton import Pose
from controller.wire.messages.commands import MOST_BYTES, FollowPerson, encode
from motiondeck_base.errors import MotiondeckError

POINTS = ("root", "head", "larm", "rarm", "lleg", "rleg")
DT = 0.01
LEARN = partial(learn_completion, recipe=CompletionRecipe(neurons=60))
HARDEST = 20.0  # m/s^2


@pytest.fixture(scope="module")
def library():
    return synthetic.small_phase_library()


@pytest.fixture(scope="module")
def person(library):
    """The joints of somebody who marches and stands elsewhere, turned by 2 rad, and where they face."""
    motion = Deck(library, lambda pose: np.zeros(1), "march").performance.motion
    joints, heading = body_course(library, motion)
    cos, sin = np.cos(2.0), np.sin(2.0)
    return joints @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) + [5.0, -3.0, 0.0], heading + 2.0


def seen(library, joints, without=()):
    own = [("root", *library.encoding.skeleton.bones).index(point) for point in POINTS]
    return {point: tuple(joints[k]) for point, k in zip(POINTS, own, strict=True) if point not in without}


def rows_of(body):
    return np.array(body[1:]).reshape(-1, 3)


def test_the_body_is_told_wherever_the_person_stands_and_faces(library, person):
    follower, skeleton = PersonFollower(library, POINTS, learn=LEARN), library.encoding.skeleton
    rng, apart = np.random.default_rng(3), []
    for joints, heading in zip(*person, strict=True):
        follower.step(seen(library, joints + 0.01 * rng.standard_normal(joints.shape)))
        own = rotate(from_rotation_vector(np.array([0.0, 0.0, -heading])), joints[1:] - joints[skeleton.parent + 1])
        own /= np.linalg.norm(own, axis=1, keepdims=True)
        apart.append(
            (np.abs(rows_of(follower.body)[1:] - own).mean(), abs(rows_of(follower.body)[0, 2] - joints[0, 2]))
        )
    assert np.mean(apart, axis=0) == pytest.approx(0.0, abs=0.06)
    assert len(encode(FollowPerson("march", 0.123456789, 1.0123456789, body=follower.body))) < MOST_BYTES


def test_the_body_leads_the_more_the_less_a_person_fits_the_motion(library, person):
    shares = []
    for lifted in (0.0, 0.3):  # m, of the head
        follower = PersonFollower(library, POINTS, learn=LEARN)
        for joints in person[0]:
            points = seen(library, joints)
            points["head"] = (*points["head"][:2], points["head"][2] + lifted)
            follower.step(points)
        shares.append(follower.body[0])
    assert shares[0] < 0.6
    assert 0.85 < shares[1] < 1.0


def test_the_body_leads_less_as_soon_as_a_person_stands(library, person):
    follower, shares = PersonFollower(library, POINTS, learn=LEARN), []
    for joints in (*person[0], *[person[0][-1]] * 8):
        follower.step(seen(library, joints))
        shares.append(follower.body[0])
    assert shares[-1] < shares[-9] - 0.08


def test_the_root_is_told_where_it_is(library, person):
    own = [("root", *library.encoding.skeleton.bones).index(point) for point in POINTS]
    joints, heading = person
    told = PersonBody(POINTS, [(joints[:, own], body_rows(library.encoding.skeleton, joints, heading))], LEARN)
    rows = np.array([told.step(one[own] + [7.0, 0.0, 0.0]) for one in joints])
    assert rows[20:, 1] == pytest.approx(joints[20:, 0] + [7.0, 0.0, 0.0], abs=0.08)
    assert rows[20:, 0, :2] == pytest.approx(np.stack([np.cos(heading), np.sin(heading)], axis=1)[20:], abs=0.1)


def test_a_point_that_is_gone_for_longer_than_half_a_second_ends_it_until_it_is_back(library, person):
    follower, told = PersonFollower(library, POINTS, learn=LEARN), []
    for step, joints in enumerate(person[0][np.arange(60) % len(person[0])]):
        follower.step(seen(library, joints, ("lleg",) if step < 5 or 10 <= step < 40 else ()))
        told.append(bool(follower.body))
    assert told == [False] * 5 + [True] * 20 + [False] * 15 + [True] * 20


def test_points_without_a_twin_tell_no_body(library, person):
    follower = PersonFollower(library, ("head", "rarm"), learn=LEARN)
    follower.step(seen(library, person[0][0]))
    assert follower.body == ()


@pytest.fixture
def stands(library):
    """A body that is bent, twisted and faces 1 rad to the left."""
    skeleton, rng = library.encoding.skeleton, np.random.default_rng(7)
    turns = multiply(yaw(1.0), from_rotation_vector(rng.uniform(-0.4, 0.4, (1 + len(skeleton), 3))))
    turns[1:] = multiply(turns[1:], from_rotation_vector(0.7 * skeleton.rest_direction))
    return skeleton, Pose(np.array([1.0, 2.0, 0.9]), np.array(1.0), turns)


def bent(skeleton, weight, rng):
    """A body whose bones are up to 1 rad off the rest pose."""
    turns = from_rotation_vector(rng.uniform(-0.6, 0.6, (len(skeleton), 3)))
    return weight, 0.0, 0.0, 0.7, *rotate(turns, skeleton.rest_direction).ravel()


def test_it_is_joined_and_left_within_the_hardest_push_and_the_motion_is_itself_again(stands):
    skeleton, pose = stands
    led, rng, joints, goal = LedBody(skeleton, HARDEST), np.random.default_rng(4), [], ()
    assert led.shown(pose, (), DT) is pose
    for tick in range(900):
        if tick % 60 == 0:  # they jump from one body to another
            goal = bent(skeleton, 0.8, rng) if tick < 600 else ()
        shown = led.shown(pose, goal, DT)
        joints.append(skeleton.joints(shown.root_position, shown.rotation))
        if tick == 599:
            own = rotate(pose.rotation[1:], skeleton.rest_direction)
            wanted = own + 0.8 * (rotate(yaw(1.0), rows_of(goal)[1:]) - own)
            wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
            assert rotate(shown.rotation[1:], skeleton.rest_direction) == pytest.approx(wanted, abs=0.05)
            assert shown.root_position == pytest.approx([1.0, 2.0, 0.74], abs=0.01)
    push = np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1).max() / DT**2
    assert 0.3 * HARDEST < push < 1.5 * HARDEST  # bones go round, which is not counted beforehand
    assert led.shown(pose, (), DT) is pose


def test_it_swings_over_nowhere_and_the_root_and_twists_turn_with_the_bones(stands):
    skeleton, pose = stands
    led, turn, far = LedBody(skeleton, HARDEST), from_rotation_vector(np.array([0.3, -0.2, 0.4])), []
    wanted = multiply(turn, pose.rotation)
    rows = rotate(multiply(yaw(-1.0), wanted[1:]), skeleton.rest_direction)
    for _ in range(300):
        shown = led.shown(pose, (1.0, 0.0, 0.0, 0.8, *rows.ravel()), DT)
        far.append(shown.root_position[2] - 0.8)
    assert min(far) > -0.001
    assert far[-1] < 0.001
    assert np.abs((shown.rotation[0] * wanted[0]).sum()) > 0.999
    twist = multiply(conjugate(shown.rotation[1:]), multiply(between_bones(pose, shown, skeleton), pose.rotation[1:]))
    assert np.abs(twist[:, 0]) == pytest.approx(1.0, abs=1e-9)


def between_bones(pose, shown, skeleton):
    return between(*(rotate(one.rotation[1:], skeleton.rest_direction) for one in (pose, shown)))


def test_the_deck_shows_a_person_who_leads_until_a_pause_or_the_end_of_the_lock(library):
    skeleton, rng = library.encoding.skeleton, np.random.default_rng(5)
    body = bent(skeleton, 0.8, rng)

    def apart(deck, free, seconds, given):
        for tick in range(round(seconds / DT)):
            if given and tick % 3 == 0:
                deck.follow("march", free.phase, free.tempo, body=body)
            for one in (deck, free):
                one.update(DT)
        bones = [rotate(one.pose.rotation[1:], skeleton.rest_direction) for one in (deck, free)]
        return np.abs(bones[0] - bones[1]).max()

    deck, free = (Deck(library, lambda pose: np.zeros(1), "march") for _ in range(2))
    assert apart(deck, free, 1.0, given=True) < 1e-9  # not locked
    deck.lock("person")
    assert apart(deck, free, 1.5, given=True) > 0.3
    assert apart(deck, free, 2.0, given=False) < 0.05  # they are gone
    assert apart(deck, free, 1.5, given=True) > 0.3
    deck.unlock()
    assert apart(deck, free, 2.0, given=True) < 0.05
    deck.lock("person")
    assert apart(deck, free, 1.5, given=True) > 0.3
    for one in (deck, free):
        one.pause()
    assert apart(deck, free, 2.0, given=True) < 0.1


@pytest.mark.parametrize("broken", ["short", "nan", "weight", "far"])
def test_a_body_of_another_skeleton_and_broken_numbers_are_refused(library, broken):
    deck = Deck(library, lambda pose: np.zeros(1), "march")
    body = [*bent(library.encoding.skeleton, 0.8, np.random.default_rng(6))]
    deck.follow("march", 0.1, body=body)
    body = {"short": body[:-3], "nan": [*body[:-1], np.nan], "weight": [1.1, *body[1:]], "far": [*body[:-1], 11.0]}[
        broken
    ]
    with pytest.raises(MotiondeckError, match="weight from 0 to 1"):
        deck.follow("march", 0.1, body=body)
