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
from controller.motion.canonical.canonical_body import CANONICAL_BONES
from controller.motion.clip import Clip
from controller.motion.skeleton import Skeleton
from simulated_bodies import human

LIMBS = [CANONICAL_BONES.index(side + end) for side in "lr" for end in ("hip", "kne", "ank", "elb", "wri")]
SPANS = [bone for bone in range(len(CANONICAL_BONES)) if bone not in LIMBS]


def take(name, factor=1.0, seed=None, seconds=1.0):
    """A take of an actor: limbs within 2 mm, as from markers, other bones some mm longer or shorter."""
    body = human()
    length = body.length * factor
    if seed is not None:
        length[SPANS] += np.random.default_rng(seed).uniform(-0.004, 0.004, len(SPANS))
        length[LIMBS] += np.random.default_rng(seed).uniform(-0.001, 0.001, len(LIMBS))
    clip = waving(60.0, seconds)
    skeleton = Skeleton(name, body.bones, body.parent, body.rest_direction, length)
    return Clip(clip.name, skeleton, clip.rate, clip.root_position, clip.rotation)


TAKES = {
    **{f"ann{number}": take(f"ann{number}", seed=number) for number in range(3)},
    **{f"bob{number}": take(f"bob{number}", 1.1, seed=10 + number) for number in range(2)},
    "cid": take("cid", 1.3, seed=20),
}


def test_takes_with_the_same_limbs_are_one_actors():
    assert [(actor.name, actor.motions) for actor in actors_of(TAKES)] == [
        ("ann0", ("ann0", "ann1", "ann2")),
        ("bob0", ("bob0", "bob1")),
        ("cid", ("cid",)),
    ]


def test_the_body_is_the_nearest_to_those_of_all_recordings():
    assert nearest_to_all(actors_of(TAKES)).name == "ann0"
    assert nearest_to_all(actors_of({**TAKES, "dan": TAKES["cid"], "cid2": TAKES["cid"]})).name == "bob0"


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
    assert [actor.name for actor in prepared[0].actors] == ["ann0", "bob0", "cid"]
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
    for frames in (len(clip), 20_000):  # more are compared in blocks
        place, rotation = (np.resize(one, (frames, *one.shape[1:])) for one in (clip.root_position, clip.rotation))
        assert hands_off(Clip("w", other, clip.rate, place, rotation), own) == pytest.approx(50.0, abs=0.1)


NAMES = dict(
    zip(
        ("hip", "kne", "ank", "foo", "sho", "elb", "wri", "han"),
        ("HipJoint", "UpLeg", "Leg", "Foot", "Shoulder", "Arm", "ForeArm", "Hand"),
        strict=True,
    )
)
MIDDLE = {"back": "Spine", "neck": "Chest", "head": "Head"}


def under_usual_names(clip, without=()):
    """The same motion in a file with usual names, some bones left out."""
    body = clip.skeleton
    kept = [bone for bone, name in enumerate(body.bones) if name not in without]
    names = [
        MIDDLE.get(name) or {"l": "Left", "r": "Right"}[name[0]] + NAMES[name[1:]]
        for name in (body.bones[k] for k in kept)
    ]
    parent = np.array([kept.index(body.parent[bone]) if body.parent[bone] >= 0 else -1 for bone in kept])
    skeleton = Skeleton("ann", tuple(names), parent, body.rest_direction[kept], body.length[kept])
    return Clip(clip.name, skeleton, clip.rate, clip.root_position, clip.rotation[:, [0, *(1 + bone for bone in kept)]])


def test_lengths_of_bones_are_those_of_takes_that_have_them():
    """A hand that a file lacks has an assumed length."""
    whole = take("ann")
    clips = {f"take{number}": under_usual_names(whole, ("lhan", "rhan")) for number in range(3)}
    (actor,) = actors_of(clips | {"whole": under_usual_names(whole)})
    hands = [CANONICAL_BONES.index(bone) for bone in ("lhan", "rhan")]
    assert np.allclose(actor.body.length[hands], whole.skeleton.length[hands])
    (without,) = actors_of(clips)
    assert not np.allclose(without.body.length[hands], whole.skeleton.length[hands], atol=1e-3)


def test_learn_says_whose_body_a_library_has_and_what_it_costs_others(mocap_data):
    folder = mocap_data / "hdm05" / "squat1Reps"
    names = ("HDM_bd_squat1Reps_002", "HDM_bd_squat1Reps_003", "HDM_bk_squat1Reps_015")
    learned = learn([folder / f"{name}_120.amc" for name in names], "squats", seeds=(0,))
    own, other = learned.actors
    assert (own.actor, own.motions, own.hands_mm) == ("HDM_bd", 2, 0.0)
    assert (other.actor, other.motions) == ("HDM_bk", 1)
    assert 20.0 < other.hands_mm < 200.0
    assert learned.library.info.skeleton.name == "HDM_bd"
