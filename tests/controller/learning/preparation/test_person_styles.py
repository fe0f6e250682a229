"""Recordings of several people as those of one: each keeps their own manner, the others say what the input does."""

import msgspec
import numpy as np
import pytest

from controller.learning.preparation.cycles import ground_speed, person_variants
from controller.learning.preparation.training_motion import Variant
from controller.learning.recipe import LibraryRecipe, MotionRecipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.training_set import prepare
from controller.motion.encodings.motion_matching import joint_features

RNG = np.random.default_rng(5)
COMMON, BY_SPEED = RNG.standard_normal((2, 40, 6))
MANNER = {person: 0.5 * RNG.standard_normal((40, 6)) for person in ("anna", "ben", "carl", "dora")}


def walk(person, speed):
    """How someone walks: what all do at a speed, and the person's own manner at any speed."""
    return Variant(speed, 1.5 / speed, COMMON + 0.4 * speed * BY_SPEED + MANNER[person])


MADE = [("anna", 0.8), ("ben", 1.0), ("ben", 2.2), ("carl", 0.9), ("carl", 1.6), ("dora", 1.9), ("dora", 1.2)]
PEOPLE, WALKS = [person for person, _ in MADE], [walk(*one) for one in MADE]


def off(frames, wanted):
    return float(np.sqrt(np.square(frames - wanted).mean()))


@pytest.mark.parametrize("speed", [1.3, 1.7, 2.1])
def test_a_person_who_was_recorded_at_one_speed_keeps_their_manner_at_others(speed):
    (found,) = person_variants("anna", WALKS, PEOPLE, [speed])
    wanted = walk("anna", speed)
    assert found.value == speed
    assert off(found.frames, wanted.frames) < 0.5 * min(off(one.frames, wanted.frames) for one in WALKS)
    assert found.seconds == pytest.approx(wanted.seconds, rel=0.1)


def test_what_was_recorded_is_nearly_kept():
    for person, one in zip(PEOPLE, WALKS, strict=True):
        (found,) = person_variants(person, WALKS, PEOPLE, [one.value])
        assert off(found.frames, one.frames) < 0.12


def test_nobody_who_was_recorded_moves_as_people_do_on_average():
    (found,) = person_variants("nobody", WALKS, PEOPLE, [1.4])
    average = COMMON + 0.4 * 1.4 * BY_SPEED + np.mean([MANNER[person] for person in MANNER], axis=0)
    assert off(found.frames, average) < 0.15


def test_what_is_the_same_in_all_recordings_stays_as_it_is():
    still = [Variant(speed, 1.0, np.full((4, 2), 3.0)) for speed in (1.0, 1.2, 3.0)]
    for person in ("anna", "nobody"):
        for found in person_variants(person, still, ["anna", "ben", "ben"], [1.0, 2.0, 3.0]):
            assert found.frames == pytest.approx(np.full((4, 2), 3.0))
            assert found.seconds == pytest.approx(1.0)


def test_a_recipe_learns_one_persons_gait_with_other_peoples_speeds(mocap_data):
    """Subject 35 was recorded walking alone; how a walk becomes a jog is subject 02's."""
    motion = MotionRecipe(
        name="gait",
        file="cmu/35/35_02.amc",
        takes=("cmu/02/02_01.amc", "cmu/02/02_03.amc"),
        input="speed",
        people=("35", "02", "02"),
    )
    taught = prepare(LibraryRecipe(name="gait", network=PhaseRecipe(), motions=[motion]), mocap_data)
    alone = prepare(LibraryRecipe(name="gait", network=PhaseRecipe(), motions=[without_people(motion)]), mocap_data)
    own, slow, jog = taught.variants["gait"]
    recorded, other, theirs = alone.variants["gait"]
    for one, before in zip((own, slow, jog), (recorded, other, theirs), strict=True):
        assert one.value == before.value == pytest.approx(ground_speed(one.frames), abs=0.02)

    def apart(one, two):
        joints = [joint_features(taught.encoding, frames) for frames in (one.frames, two.frames)]
        return float(np.abs(joints[0] - joints[1]).mean())

    assert apart(own, recorded) < 4.0  # mm
    assert apart(slow, recorded) < 0.5 * apart(other, recorded)  # at subject 02's speed, in subject 35's manner


def without_people(motion):
    return msgspec.structs.replace(motion, people=())
