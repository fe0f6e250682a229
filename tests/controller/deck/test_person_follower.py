"""A person's motion, phase and tempo are found from three points, wherever they stand and whatever is lost."""

import msgspec
import numpy as np
import pytest

import synthetic
from controller.deck.deck import Deck
from controller.deck.motion_generator import MotionGenerator
from controller.deck.person_follower import PersonFollower
from controller.learning.fit import fit
from controller.learning.recipe import gesture_recipe
from controller.learning.trainers.clip import ClipRecipe
from controller.library.motion_library import load_library
from controller.motion.formats.taught_clip import save_taught_clip, taught_clip
from controller.motion.skeleton import walk_path
from controller.wire.messages.arguments import CommandError
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_library

POINTS = ("head", "rhan", "lhan")
RATE = 30.0
HELD_UP = {"head": 0.0, "rhan": -0.1, "lhan": -0.1}  # m


class Leader:
    """A person who does a motion of the library, turned and elsewhere; `phase` is the truth."""

    def __init__(self, library, motion, tempo=1.0, phase=0.2, seed=1, steps=60):
        playing = MotionGenerator(library, motion, tempo=tempo, phase=phase)
        rows, self._phases = zip(*((playing.step(1.0 / RATE), playing.phase) for _ in range(steps)), strict=True)
        pose = walk_path(library.encoding.decode(np.array(rows)), 1.0 / RATE)
        skeleton = library.encoding.skeleton
        joints = skeleton.joints(pose.root_position, pose.rotation)
        own = joints[:, [1 + skeleton.bones.index(point) for point in POINTS]]
        cos, sin = np.cos(2.0), np.sin(2.0)
        own = own @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) + np.array([5.0, -3.0, 0.0])
        self._rng = np.random.default_rng(seed)
        self._places, self._step = own + 0.02 * self._rng.standard_normal(own.shape), -1

    @property
    def phase(self):
        return self._phases[self._step]

    def points(self):
        """A fifth of them is lost."""
        self._step += 1
        own = zip(POINTS, self._places[self._step].tolist(), strict=True)
        return {point: tuple(place) for point, place in own if self._rng.random() >= 0.2}


@pytest.fixture(scope="module")
def library():
    return synthetic.small_phase_library()


@pytest.fixture(scope="module")
def people():
    """Motions of people: the phase of the synthetic march can hardly be seen in its arms."""
    return load_library(find_library("thesis15"))


def apart(found, phase):
    return abs((found - phase + 0.5) % 1.0 - 0.5)


@pytest.mark.parametrize(("motion", "tempo"), [("walk", 1.0), ("jog", 0.6), ("waltz", 1.7)])
def test_motion_phase_and_tempo_are_found_within_half_a_second_of_noise_and_loss(people, motion, tempo):
    follower, leader = PersonFollower(people, POINTS), Leader(people, motion, tempo)
    found = []
    for _ in range(60):
        found.append((follower.step(leader.points()), leader.phase))
    assert all(place is not None and place[0] == motion for place, _ in found[15:])
    assert np.mean([apart(place[1], phase) for place, phase in found[15:]]) < 0.06
    assert np.mean([place[2] for place, _ in found[30:]]) == pytest.approx(tempo, abs=0.25)


def test_after_a_jump_of_the_phase_and_a_silence_it_is_found_again_within_0_3_s(people):
    follower, leader = PersonFollower(people, POINTS), Leader(people, "waltz", phase=0.1)
    for _ in range(30):
        follower.step(leader.points())
    leader = Leader(people, "waltz", phase=0.65)
    for _ in range(9):
        follower.step(leader.points())
    assert apart(follower.step(leader.points())[1], leader.phase) < 0.06
    for _ in range(3):
        leader.points()
        follower.step({})
    assert apart(follower.step(leader.points())[1], leader.phase) < 0.06


def test_a_person_of_another_height_is_followed_where_it_is_said(people):
    follower, leader = PersonFollower(people, POINTS, height=1.2), Leader(people, "walk")
    scale = 1.2 / 1.675  # the height of the library's body
    for _ in range(30):
        points = {name: tuple(scale * value for value in place) for name, place in leader.points().items()}
        place = follower.step(points)
    assert place[0] == "walk"
    assert apart(place[1], leader.phase) < 0.06


JOINTS = ("pan", "tilt", "jaw", "lid")


def rig_angles(motion, t):
    """The angles of JOINTS, rad, in two loops of 2 s and 1.6 s."""
    turn = 2.0 * np.pi * t / {"nod": 2.0, "sway": 1.6}[motion]
    if motion == "nod":
        return np.stack([0.1 * np.sin(turn), 0.4 * np.cos(turn), 0.3 * np.sin(turn), 0.0 * t], axis=-1)
    return np.stack([0.6 * np.sin(turn), 0.1 * np.cos(turn), 0.0 * t, 0.3 * np.sin(turn)], axis=-1)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    folder, t = tmp_path_factory.mktemp("rig"), np.arange(400) / 50.0
    for motion in ("nod", "sway"):
        clip = taught_clip(motion, JOINTS, 50.0, rig_angles(motion, t))
        save_taught_clip(clip, folder / f"{motion}.clip", "loop")
    recipe = gesture_recipe("gestures", [folder / "nod.clip", folder / "sway.clip"])
    return fit(msgspec.structs.replace(recipe, network=ClipRecipe()), folder)


@pytest.mark.parametrize(("motion", "tempo"), [("nod", 1.0), ("sway", 0.7)])
def test_a_rig_that_is_moved_by_hand_leads_by_the_angles_of_some_joints(rig, motion, tempo):
    follower, rng, found = PersonFollower(rig, ("pan", "tilt")), np.random.default_rng(2), []
    t = tempo * np.arange(90) / RATE
    for angles in rig_angles(motion, t)[:, :2] + 0.05 * rng.standard_normal((90, 2)):
        seen = zip(("pan", "tilt"), angles.tolist(), strict=True)
        found.append(follower.step({joint: (0.0, 0.0, angle) for joint, angle in seen if rng.random() >= 0.2}))
    assert all(place is not None and place[0] == motion for place in found[20:])
    # A learned loop has some rounds, and where it begins is its own affair: the phase goes on as the hand does.
    seconds = {"nod": 2.0, "sway": 1.6}[motion]
    rounds = next(round(one.frames / rig.info.rate / seconds) for one in rig.info.motions if one.name == motion)
    ahead = np.unwrap([2.0 * np.pi * (rounds * place[1] % 1.0) for place in found[20:]]) / (2.0 * np.pi)
    line = np.polyfit(t[20:] / seconds, ahead, 1)
    assert line[0] == pytest.approx(1.0, abs=0.1)
    assert np.abs(ahead - np.polyval(line, t[20:] / seconds)).max() < 0.1
    assert np.mean([place[2] for place in found[40:]]) == pytest.approx(tempo, abs=0.3)


def test_the_hands_of_a_person_who_holds_them_otherwise_are_learned(people):
    follower, leader = PersonFollower(people, POINTS), Leader(people, "waltz", steps=120)
    missed = []
    for _ in range(120):
        points = leader.points()
        held = {point: (x, y, z + HELD_UP[point]) for point, (x, y, z) in points.items()}
        place = follower.step(held)
        missed.append(apart(place[1], leader.phase) if place is not None and place[0] == "waltz" else 0.5)
    assert np.mean(missed[60:]) < 0.02


def test_an_unknown_point_a_wrong_height_and_a_network_without_phase_are_refused(people, rig):
    with pytest.raises(UnknownNameError, match="rhan"):
        PersonFollower(people, ("rham",))
    with pytest.raises(MotiondeckError, match="175 m"):
        PersonFollower(people, POINTS, height=175.0)
    with pytest.raises(UnknownNameError, match="pan"):
        PersonFollower(rig, ("pam",))
    with pytest.raises(MotiondeckError, match="a rig has none"):
        PersonFollower(rig, ("pan",), height=1.7)
    with pytest.raises(MotiondeckError, match="no phase"):
        PersonFollower(synthetic.small_library(), ("head",))


DT = 0.01


def played(deck, seconds, person=None):
    """Plays on; a person gives where they are 30 times a second: (motion, phase, tempo) at a time since then, s."""
    rows = []
    for tick in range(round(seconds / DT)):
        if person is not None and tick % 3 == 0:
            deck.follow(*person(tick * DT))
        rows.append(deck.update(DT)[0].copy())
    return np.array(rows)


def test_a_deck_follows_into_another_motion_stops_with_them_and_plays_on_when_they_are_gone(library):
    def joints_of(pose):
        return library.encoding.skeleton.joints(np.zeros(3), pose.rotation).ravel()

    deck = Deck(library, joints_of, "march")
    deck.lock("person")
    wave = 1.0  # s of a round
    rows = [played(deck, 3.0, lambda time: ("wave", (0.4 + time / wave) % 1.0, 1.0))]
    assert deck.motion == "wave"
    assert deck.lock_state.source == "person"
    assert apart(deck.phase, (0.4 + 3.0 / wave) % 1.0) < 0.03
    stands = (0.4 + 3.0 / wave) % 1.0
    rows.append(played(deck, 2.0, lambda time: ("wave", stands, 0.0)))
    assert abs(deck.tempo) < 0.05
    assert apart(deck.phase, stands) < 0.03
    rows.append(played(deck, 0.4))
    assert abs(deck.tempo) < 0.1  # not yet let go
    rows.append(played(deck, 2.0))
    assert deck.tempo == pytest.approx(1.0)
    assert deck.lock_state.state == "searching"
    joints = np.concatenate(rows)
    free = played(Deck(library, joints_of, "wave"), 2.0)
    assert np.abs(np.diff(joints, axis=0)).max() < 3.0 * np.abs(np.diff(free, axis=0)).max()


def test_half_a_round_away_it_jumps_at_once_and_stops_when_they_do(library):
    deck = Deck(library, lambda pose: pose.root_position, "march")
    deck.lock("person")
    played(deck, 0.1, lambda time: ("wave", 0.7 + time, 1.0))
    assert apart(deck.phase, 0.8) < 0.05  # it begins where they are
    played(deck, 2.0, lambda time: ("wave", (0.8 + time) % 1.0, 1.0))
    played(deck, 0.1, lambda time: ("wave", 0.3 + time, 1.0))
    assert apart(deck.phase, 0.4) < 0.05
    played(deck, 2.0, lambda time: ("wave", (0.4 + time) % 1.0, 1.0))
    played(deck, 0.2, lambda time: ("wave", 0.4, 0.0))
    assert abs(deck.tempo) < 0.1
    assert apart(deck.phase, 0.4) < 0.03


def test_a_one_shot_is_followed_too_and_an_unlocked_deck_does_not_listen(library):
    deck = Deck(library, lambda pose: pose.root_position, "march")
    played(deck, 0.5, lambda time: ("wave", 0.2, 1.0))
    assert deck.motion == "march"
    deck.lock("person")
    seconds = deck.performance.motions["bow"].whole
    played(deck, 0.6 * seconds / 0.5, lambda time: ("bow", min(0.5 * time / seconds, 1.0), 0.5))
    assert deck.motion == "bow"
    assert deck.phase == pytest.approx(0.6, abs=0.05)
    deck.unlock()
    with pytest.raises(CommandError, match="PHASE"):
        deck.follow("bow", 1.5)
    with pytest.raises(UnknownNameError, match="bow"):
        deck.follow("bo", 0.5)
