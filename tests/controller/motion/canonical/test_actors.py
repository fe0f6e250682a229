"""The actors of recordings, and the one body of a library."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import waving
from controller.learning.learn import learn
from controller.learning.recipe import LibraryRecipe, MotionRecipe
from controller.learning.training_set import prepare
from controller.motion.canonical.actors import actors_of, hands_off, nearest_to_all
from controller.motion.canonical.canonical_body import CANONICAL_BONES, to_canonical
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip
from controller.motion.skeleton import Skeleton
from simulated_bodies import human

LIMBS = [CANONICAL_BONES.index(side + end) for side in "lr" for end in ("hip", "kne", "ank", "elb", "wri")]
SPANS = [bone for bone in range(len(CANONICAL_BONES)) if bone not in LIMBS]


def take(name, factor=1.0, seed=None, seconds=1.0):
    """A take of an actor: limbs as they are, other bones a few mm longer or shorter."""
    body = human()
    length = body.length * factor
    if seed is not None:
        length[SPANS] += np.random.default_rng(seed).uniform(-0.004, 0.004, len(SPANS))
    clip = waving(60.0, seconds)
    skeleton = Skeleton(name, body.bones, body.parent, body.rest_direction, length)
    return Clip(clip.name, skeleton, clip.rate, clip.root_position, clip.rotation)


TAKES = {
    **{f"ann{number}": take("ann", seed=number) for number in range(3)},
    **{f"bob{number}": take("bob", 1.1, seed=10 + number) for number in range(2)},
    "cid": take("cid", 1.3, seed=20),
}


def test_takes_with_the_same_limbs_are_one_actors():
    assert [(actor.name, actor.motions) for actor in actors_of(TAKES)] == [
        ("ann", ("ann0", "ann1", "ann2")),
        ("bob", ("bob0", "bob1")),
        ("cid", ("cid",)),
    ]


def test_the_body_is_the_nearest_to_those_of_all_recordings():
    assert nearest_to_all(actors_of(TAKES)).name == "ann"
    assert nearest_to_all(actors_of({**TAKES, "dan": TAKES["cid"], "cid2": TAKES["cid"]})).name == "bob"


@given(st.permutations(list(TAKES)))
def test_the_order_of_files_has_no_influence_on_the_body(order):
    one, other = (nearest_to_all(actors_of({name: TAKES[name] for name in names})) for names in (TAKES, order))
    assert one.name == other.name
    assert np.array_equal(one.body.length, other.body.length)
    assert np.array_equal(one.body.rest_direction, other.body.rest_direction)


def test_nor_on_the_training_frames():
    prepared = []
    for names in (TAKES, [*TAKES][::-1]):
        motions = [MotionRecipe(name=name, file=name, plays="loop") for name in names]
        prepared.append(prepare(LibraryRecipe(motions=motions), None, read=lambda motion: TAKES[motion.name]))
    assert [actor.name for actor in prepared[0].actors] == ["ann", "bob", "cid"]
    for name in TAKES:
        assert np.array_equal(prepared[0].frames[name], prepared[1].frames[name])


def test_a_body_costs_its_own_actor_a_few_mm_and_others_what_their_arms_differ():
    body = nearest_to_all(actors_of(TAKES)).body
    assert hands_off(TAKES["ann0"], body) < 10.0
    longer = TAKES["ann0"].skeleton.length.copy()
    longer[[CANONICAL_BONES.index(bone) for bone in ("lelb", "relb")]] += 0.05
    own = TAKES["ann0"].skeleton
    other = Skeleton("dan", own.bones, own.parent, own.rest_direction, longer)
    clip = TAKES["ann0"]
    assert hands_off(Clip("w", other, clip.rate, clip.root_position, clip.rotation), own) == pytest.approx(
        50.0, abs=0.1
    )


def test_takes_of_one_actor_have_the_hands_of_those_that_record_them(mocap_data):
    """Bandai-Namco's files of other styles have no ends of hands, for which others' assumed lengths would pass."""
    folder = mocap_data / "bvh" / "bandai"
    clips = {name: read_clip(folder / f"{name}_001.bvh") for name in ("bow_happy", "punch_normal", "walk_old")}
    (actor,) = actors_of(clips)
    hand = CANONICAL_BONES.index("lhan")
    assert actor.body.length[hand] == to_canonical(clips["punch_normal"]).skeleton.length[hand]
    assert actor.body.length[hand] != to_canonical(clips["bow_happy"]).skeleton.length[hand]


def test_learn_says_whose_body_a_library_has_and_what_it_costs_others(mocap_data):
    folder = mocap_data / "hdm05" / "squat1Reps"
    names = ("HDM_bd_squat1Reps_002", "HDM_bd_squat1Reps_003", "HDM_bk_squat1Reps_015")
    learned = learn([folder / f"{name}_120.amc" for name in names], "squats", seeds=(0,))
    own, other = learned.actors
    assert (own.actor, own.motions, own.hands_mm) == ("HDM_bd", 2, 0.0)
    assert (other.actor, other.motions) == ("HDM_bk", 1)
    assert 20.0 < other.hands_mm < 200.0
    assert learned.library.info.skeleton.name == "HDM_bd"
