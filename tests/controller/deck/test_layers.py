"""Layers: groups of joints that play motions of their own, without a jump and without a trace on other joints."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits
from controller.deck.layers import MOST_VOICES, Layers
from controller.learning.fit import fit
from controller.learning.recipe import gesture_recipe
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.formats.taught_clip import save_taught_clip, taught_clip
from controller.motion.rotations import to_rotation_vector
from motiondeck_base.errors import MotiondeckError, UnknownNameError

DT = 0.01
JOINTS = ("pan", "jaw", "left", "right")
LIMITS = JointLimits(*np.array([[-1.5, 1.5, 8.0, 400.0, 2e4]] * len(JOINTS)).T)
GROUPS = {"arms": ("left", "right"), "face": ("jaw", "pan")}
t = np.arange(200) / 50.0
TAUGHT = {
    "sway": ("loop", [0.5 * np.sin(np.pi * t), 0 * t, 0.4 * np.cos(np.pi * t), 0.2 * np.sin(2 * np.pi * t)]),
    "wave": ("loop", [0.1 + 0 * t, 0.3 * np.sin(3 * np.pi * t), 0.7 * np.sin(2 * np.pi * t), -0.5 + 0 * t]),
    "bow": ("once", [0 * t, 0.4 * np.sin(np.pi * t / 4) ** 2, 0.9 * (t / 4) ** 2 * (3 - t / 2), 0 * t]),
}
BONES = [1 + [name for name, *_ in synthetic.BODY].index(bone) for bone in ("rleg", "lleg", "rarm", "larm")]


def limb_joints():
    """Stands in for a robot whose joints are named as above: legs and arms of the synthetic body."""
    return lambda pose: to_rotation_vector(pose.rotation[BONES])[:, :2].sum(1)


def taught_joints(library):
    return lambda: JointRetargeter(library.skeleton, JOINTS, np.zeros(len(JOINTS)))


@pytest.fixture(scope="module")
def library():
    return synthetic.small_phase_library()


@pytest.fixture(scope="module")
def taught(tmp_path_factory):
    folder = tmp_path_factory.mktemp("layers")
    for name, (plays, angles) in TAUGHT.items():
        save_taught_clip(taught_clip(name, JOINTS, 50.0, np.stack(angles, axis=1)), folder / f"{name}.clip", plays)
    return fit(gesture_recipe("gestures", [folder / f"{name}.clip" for name in TAUGHT]), folder)


def new_deck(library, motion, twin=limb_joints, *, layers=True, refused=None):
    deck = Deck(library, twin(), motion)
    deck.layers = Layers(library, JOINTS, LIMITS, GROUPS, twin, refused) if layers else None
    return deck


def play(deck, seconds, dt=DT):
    """Joint targets while the deck plays on, shape (ticks, J), rad."""
    return np.array([deck.update(dt)[0].copy() for _ in range(round(seconds / dt))])


def peaks(targets, dt):
    """The largest speed, rad/s, and acceleration, rad/s^2, of any joint."""
    step = np.diff(targets, axis=0)
    return np.array([np.abs(step).max() / dt, np.abs(np.diff(step, axis=0)).max() / dt**2])


SAYINGS = st.tuples(
    st.sampled_from(["arms", "face", "jaw", "left", "off", "switch"]),
    st.sampled_from(["sway", "wave", "bow", "off"]),
    st.sampled_from([1.0, 0.7, 0.3]),
    st.sampled_from([1.0, 0.5]),
    st.floats(0.05, 2.5),
)


def follow(deck, schedule):
    """Joint targets (ticks, J) while commands are given, each followed by some seconds, and the joints with layers."""
    layered, targets = set(), []
    for group, motion, weight, tempo, seconds in schedule:
        if group == "switch":
            deck.switch("wave" if motion == "off" else motion)
        elif deck.layers is not None:
            deck.layer(group, motion, weight, tempo)
        layered |= set(GROUPS.get(group, (group,)))
        targets.append(play(deck, seconds, 0.005).reshape(-1, len(JOINTS)))
    return np.concatenate(targets), [index for index, name in enumerate(JOINTS) if name in layered]


@pytest.mark.thorough
@pytest.mark.timeout(900)
def test_joins_of_random_schedules_keep_to_their_limits_and_other_joints_are_untouched(taught):
    twin = taught_joints(taught)
    alone = [play(new_deck(taught, name, twin, layers=False), 5.0, 0.005) for name in TAUGHT]
    own = np.max([peaks(targets, 0.005) for targets in alone], axis=0)

    @settings(max_examples=200, deadline=None)
    @given(st.lists(SAYINGS, min_size=3, max_size=9))
    def check(schedule):
        mixed, layered = follow(new_deck(taught, "sway", twin), schedule)
        plain, _ = follow(new_deck(taught, "sway", twin, layers=False), schedule)
        outside = np.setdiff1d(np.arange(len(JOINTS)), layered)
        assert np.array_equal(mixed[:, outside], plain[:, outside])
        assert (peaks(mixed, 0.005) / own <= [1.5, 2.0]).all()

    check()


def test_a_layer_arrives_at_its_weight_and_its_end_leaves_nothing(library):
    deck, plain = new_deck(library, "march"), new_deck(library, "march", layers=False)
    own = new_deck(library, "wave", layers=False)
    deck.layer("arms", "wave", 0.5)
    assert deck.layered == {"arms": "wave"}
    mixed, alone, over = (play(one, 5.0) for one in (deck, plain, own))
    assert mixed[-1, 2:] == pytest.approx(0.5 * (alone[-1, 2:] + over[-1, 2:]), abs=1e-6)
    assert np.abs(mixed[:2, 2:] - alone[:2, 2:]).max() < 0.01  # it begins where the joints are
    assert np.array_equal(mixed[:, :2], alone[:, :2])
    deck.layer("off", "off")
    play(deck, 5.0), play(plain, 5.0)
    assert deck.layered == {}
    assert np.array_equal(play(deck, 0.2), play(plain, 0.2))


def test_a_later_motion_of_a_group_takes_over_and_a_one_shot_ends_its_layer(library):
    deck, plain = new_deck(library, "march"), new_deck(library, "march", layers=False)
    deck.layer("arms", "wave")
    play(deck, 3.0), play(plain, 3.0)
    deck.layer("arms", "bow")
    assert deck.layered == {"arms": "bow"}
    play(deck, 6.0), play(plain, 6.0)
    assert deck.layered == {}
    assert np.array_equal(play(deck, 0.2), play(plain, 0.2))


def test_a_pause_holds_layers_too(library):
    deck = new_deck(library, "march")
    deck.layer("left", "wave", tempo=0.5)
    play(deck, 3.0)
    deck.pause()
    assert np.ptp(play(deck, 0.6)[-10:], axis=0) == pytest.approx(np.zeros(4), abs=1e-6)


def test_what_cannot_be_layered_is_refused_by_name(library):
    deck = new_deck(library, "march")
    with pytest.raises(UnknownNameError, match=r"unknown group 'arm'.*Did you mean arms"):
        deck.layer("arm", "wave")
    with pytest.raises(UnknownNameError, match=r"unknown motion 'waev'.*Did you mean wave"):
        deck.layer("arms", "waev")
    with pytest.raises(MotiondeckError, match="it stands on its own feet"):
        new_deck(library, "march", refused={"left": "it stands on its own feet"}).layer("arms", "wave")
    with pytest.raises(MotiondeckError, match="there are no layers here"):
        new_deck(library, "march", layers=False).layer("arms", "wave")
    for _ in range(MOST_VOICES // 2):
        deck.layer("arms", "wave")
        deck.layer("arms", "march")
    with pytest.raises(MotiondeckError, match=f"{MOST_VOICES} layers come and go"):
        deck.layer("arms", "wave")
