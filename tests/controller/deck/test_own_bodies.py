"""The body that a deck shows: that of the motion's recording at rest, and a smooth way to the next one in a switch."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary
from controller.motion.canonical.canonical_body import carried, root_height
from controller.motion.clip import Clip
from controller.motion.encodings.bone_directions import BoneDirections
from controller.motion.rotations import conjugate, from_rotation_vector, multiply, rotate, yaw
from controller.motion.skeleton import JAEGER_BONES, thesis_skeleton
from shipped_libraries import shipped
from simulated_bodies import smooth_poses

DT = 0.005


def deck_of(motion):
    library = shipped()
    return library, Deck(library, lambda pose: pose.root_position, motion, direct=True)


def test_a_motion_at_rest_has_the_body_of_its_recording():
    library, deck = deck_of("walk")
    body, skeleton = library.body("walk"), library.skeleton
    assert np.abs(body.length - skeleton.length).max() > 0.05
    assert np.linalg.norm(deck.pose.offsets, axis=1) / skeleton.leg_length == pytest.approx(
        body.length / body.leg_length
    )
    begun = deck.pose.offsets
    for _ in range(50):
        deck.update(DT)
        assert deck.pose.offsets is begun  # a body that does not change costs nothing


def test_bodies_change_smoothly_in_a_switch_even_if_it_is_interrupted():
    library, deck = deck_of("walk")
    seen = []
    for tick in range(600):
        if tick == 100:
            deck.switch("waltz")
        elif tick == 180:
            deck.switch("box2")
        deck.update(DT)
        seen.append(deck.pose.offsets)
    assert seen[-1] is seen[-2]
    assert seen[-1] == pytest.approx(library.offsets("box2"))
    assert np.ptp(seen, axis=0).max() > 0.04
    speed = np.diff(seen, axis=0) / DT
    assert np.abs(speed).max() < 0.3  # m/s
    assert np.abs(np.diff(speed, axis=0)).max() / DT < 3.0  # m/s^2


def test_a_blend_has_the_mean_of_its_bodies():
    library, deck = deck_of("walk")
    for tick in range(500):
        if tick == 50:
            deck.blend_in("walk", "jog", 0.4)
        deck.update(DT)
    assert dict(deck.blend) == pytest.approx({"jog": 0.4})
    assert deck.pose.offsets == pytest.approx(0.6 * library.offsets("walk") + 0.4 * library.offsets("jog"))


def test_another_body_has_its_lowest_joint_as_high():
    library, deck = deck_of("walk")
    for _ in range(40):
        deck.update(DT)
        pose, skeleton = deck.pose, library.skeleton
        own = skeleton.with_offsets(pose.offsets)
        place = np.append(pose.root_position[:2], root_height(pose, skeleton, own))
        lows = [
            body.joints(root, pose.rotation)[:, 2].min()
            for body, root in ((skeleton, pose.root_position), (own, place))
        ]
        assert lows[0] == pytest.approx(lows[1], abs=0.02)


@pytest.mark.parametrize(("bend", "wider"), [(-0.6, 0.0), (0.0, 0.0), (0.6, 0.0), (0.0, 0.02)])
def test_a_body_is_shown_as_recorded_whatever_the_pose_that_its_file_rests_in(bend, wider):
    def person(half, arm):
        body = thesis_skeleton(np.where(np.isin(JAEGER_BONES, ("rkne", "lkne", "rank", "lank")), 0.44, 0.2))
        hips = np.array([[0.03, side * half, -0.08] for side in (-1.0, 1.0)])
        offsets = body.offsets.copy()
        offsets[[body.index("rhip"), body.index("lhip")]] = hips
        offsets[body.index("relb")] *= arm
        return body.with_offsets(offsets)

    library, recorded = person(0.09, 1.0), person(0.09 + wider, 1.1)
    turns = np.array([pose.rotation for pose in smooth_poses(recorded, np.random.default_rng(5), 40, reach=0.4)])
    hips = [1 + recorded.index("rhip"), 1 + recorded.index("lhip")]
    turns[:, [0, *hips]] = turns[:, 1 + recorded.index("back"), None].copy()  # a pelvis is rigid
    bent, rest = from_rotation_vector(np.array([0.0, bend, 0.0])), recorded.rest_direction.copy()
    rest[[hip - 1 for hip in hips]] = rotate(bent, rest[[hip - 1 for hip in hips]])
    file = replace(recorded, rest_direction=rest)
    turns[:, hips] = multiply(turns[:, hips], conjugate(bent))
    clip = Clip("swing", file, 120.0, np.zeros((len(turns), 3)), turns)
    encoding, on_library = BoneDirections(library), carried(clip, library)
    played = encoding.rotations(encoding.encode(on_library))
    ahead = conjugate(yaw(encoding.heading(on_library.rotation)))[:, None]
    offsets = MotionLibrary.offsets(SimpleNamespace(skeleton=library, body=lambda _: file), "swing")
    shown = library.with_offsets(offsets).joints(np.zeros((len(turns), 3)), played)
    wanted = file.joints(np.zeros((len(turns), 3)), multiply(ahead, turns))
    apart = (one - one[:, hips].mean(axis=1, keepdims=True) for one in (shown, wanted))
    assert np.abs(np.subtract(*apart)).max() < (0.005 if wider else 1e-6)
