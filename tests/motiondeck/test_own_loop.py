"""A deck that a program steps itself: safe at any step, the same each time, and commanded as a live deck is."""

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import motiondeck
import synthetic
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.commands import Jump, Switch
from controller.wire.messages.replies import Accepted, PhaseNow
from motiondeck import MotiondeckError, UnknownNameError
from motiondeck.libraries import Library

LIBRARY = Library(synthetic.small_phase_library())
ALL_COMMANDS = [
    *(f"switch {motion}" for motion in synthetic.MOTIONS),
    "switch bow direct",
    "queue march",
    "blend march wave 0.4",
    "layer arms wave 0.7",
    "input head 0.7",
    "input arms -0.4 2",
    "gaze 0.4 -0.2",
    "input off",
    "tempo 3",
    "tempo -1 0.5",
    "jump 0.3",
    "pause",
    "step 0.1",
    "resume",
    "home",
    "estop",
    "reset",
    "beat",
    "lock beat",
    "unlock",
    "status",
    "phase",
    "stop",
]
STEPS = st.one_of(st.sampled_from([0.005, 0.01, 1.0 / 60.0]), st.floats(1e-3, 0.08))
SCRIPTS = st.lists(st.tuples(st.sampled_from(ALL_COMMANDS), st.lists(STEPS, min_size=1, max_size=25)), max_size=8)


def new_deck(motion="march", **options):
    return motiondeck.Deck(LIBRARY, motion, **options)


def played(deck, script):
    """The targets (T, J), rad, and times (T,), s, of a script of commands, each followed by steps."""
    times, targets = [0.0], [deck.step(0.0)]
    for command, steps in script:
        with contextlib.suppress(CommandError):
            deck.send(command)
        for dt in steps:
            targets.append(deck.step(dt))
            times.append(deck.time)
    return np.array(targets), np.array(times)


def assert_within_limits(limits, targets, times):
    """The four limits in time: a divided difference is a mean of the derivative, however uneven the times are."""
    assert (targets >= limits.lower).all()
    assert (targets <= limits.upper).all()
    differences = targets
    for order, most in enumerate((limits.velocity, limits.acceleration, limits.jerk), 1):
        apart = times[order:] - times[:-order]
        differences = order * np.diff(differences, axis=0) / apart[:, None]
        assert (np.abs(differences) <= most * (1.0 + 1e-6)).all(), f"order {order}"


@settings(max_examples=12)
@given(SCRIPTS, st.booleans())
def test_any_commands_in_any_steps_keep_the_limits_and_twice_give_the_same(script, from_elsewhere):
    start = np.full(len(new_deck().joints), 0.2) if from_elsewhere else None
    script = [("status", [0.02] * 10), *script]
    targets, times = played(deck := new_deck(start=start), script)
    assert_within_limits(deck.limits, targets, times)
    again, _ = played(new_deck(start=start), script)
    assert np.array_equal(targets, again)


def test_what_is_played_does_not_depend_on_how_time_is_divided():
    coarse, fine = new_deck(), new_deck()
    for deck in (coarse, fine):
        deck.step(0.0)
        deck.switch("wave")
    for _ in range(60):
        target = coarse.step(0.02)
        for dt in (0.007, 0.0005, 0.0125):
            same = fine.step(dt)
        assert same == pytest.approx(target, abs=1e-9)
        assert fine.pose.root_position == pytest.approx(coarse.pose.root_position, abs=1e-9)
        assert fine.root == pytest.approx(coarse.root, abs=1e-9)


def test_it_walks_and_switches():
    deck = new_deck()
    switch = deck.switch("wave")
    assert (switch.to, switch.settled_s) == ("wave", None)
    while switch.settled_s is None and deck.time < 5.0:
        deck.step(0.01)
    assert deck.status().motion == "wave"
    assert [event.kind for event in deck.events()] == ["motion", "settled"]
    assert deck.events() == []
    assert deck.root.shape == (7,)


def test_it_is_commanded_by_text_by_messages_and_by_methods():
    deck = new_deck()
    deck.step(0.01)
    assert isinstance(deck.send("blend march wave 0.3"), Accepted)
    assert isinstance(deck.send(Switch("march")), Accepted)
    assert isinstance(deck.send("phase"), PhaseNow)
    deck.tempo = 2.0
    deck.set_tempo(1.5, over=2.0)
    deck.step(1.0)
    deck.jump(0.4)
    deck.beat()
    assert deck.locked_to.source == "beat"
    deck.pause()
    deck.step_paused(0.2)
    for refused in (
        Jump(1.5),
        "switch bo",
        "heartbeat 1",
        "subscribe",
        "load other.safetensors walk",
        "push left",
        "scan",
    ):
        with pytest.raises(CommandError):
            deck.send(refused)
    with pytest.raises(CommandError, match="Did you mean wave"):
        deck.switch("wavee")
    with pytest.raises(CommandError, match="factor: expected float"):
        deck.tempo = "fast"
    with pytest.raises(CommandError, match="first: expected str"):
        deck.blend(3, "wave", 0.5)
    with pytest.raises(AttributeError):
        deck.tmpo = 2.0


def test_the_joints_approach_from_where_they_are_measured():
    deck = new_deck()
    elsewhere = np.clip(np.full(len(deck.joints), 0.3), deck.limits.lower, deck.limits.upper)
    elsewhere[0] = np.nan  # not measured: taken to be where the motion begins
    first = deck.step(0.0, measured=elsewhere)
    assert first[1:] == pytest.approx(elsewhere[1:])
    assert np.isfinite(first).all()
    assert deck.step(0.01) == pytest.approx(first, abs=1e-3)
    assert deck.status().approaching
    while deck.status().approaching and deck.time < 30.0:
        deck.step(0.02)
    assert deck.status().at == pytest.approx(0.005, abs=0.05)  # the motion has waited


def test_a_held_body_is_waited_for():
    deck = new_deck()
    q = deck.step(0.01)
    for _ in range(200):  # it follows for two seconds, so that its poses are known
        q = deck.step(0.01, measured=q)
    deck.lock("body")
    held = q
    for _ in range(100):
        deck.step(0.01, measured=held)
    assert deck.locked_to.state == "waiting"
    assert abs(deck.tempo) < 0.5


def test_an_emergency_stop_brakes_and_holds_until_it_is_reset():
    deck = new_deck()
    deck.tempo = 2.0
    for _ in range(100):
        moving = deck.step(0.01)
    deck.emergency_stop()
    with pytest.raises(CommandError, match="emergency stop is on"):
        deck.switch("wave")
    with pytest.raises(CommandError, match="still braking"):
        deck.reset()
    for _ in range(100):
        held = deck.step(0.01)
    assert np.array_equal(held, deck.step(0.5))
    assert np.abs(held - moving).max() < 0.5
    deck.reset()
    assert deck.status().mode == "held"
    deck.resume()
    assert [(event.kind, event.text) for event in deck.events()] == [
        *(("mode", "emergency stop"), ("paused", "paused")),
        *(("mode", "held"), ("mode", "playing"), ("resumed", "plays on")),
    ]
    for _ in range(200):
        deck.step(0.01)
    assert deck.status().mode == "playing"
    assert not np.array_equal(held, deck.step(0.0))


def test_it_goes_home_and_ends():
    deck = new_deck()
    deck.step(0.1)
    deck.home()
    for _ in range(2000):
        rest = deck.step(0.01)
    assert np.array_equal(rest, deck.step(1.0))
    assert deck.running
    deck.send("stop")
    for _ in range(3):
        assert deck.step(0.1) == pytest.approx(rest)
    assert (deck.running, deck.reason) == (False, "stopped on command")


@pytest.mark.parametrize("dt", [-0.01, float("nan"), float("inf"), 11.0])
def test_a_wrong_step_advances_nothing(dt):
    deck = new_deck()
    with pytest.raises(MotiondeckError, match="give 0 to 10 s"):
        deck.step(dt)
    with pytest.raises(MotiondeckError, match=r"shape \(2,\)"):
        deck.step(0.01, measured=[0.0, 0.0])
    assert deck.time == 0.0


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"library": "thesis14"}, "Did you mean thesis15"),
        ({"library": LIBRARY, "motion": "marhc"}, "Did you mean march"),
        ({"library": LIBRARY, "robot": "servo21"}, "Did you mean servo20"),
    ],
)
def test_a_name_that_does_not_exist_is_refused(wrong, says):
    with pytest.raises(UnknownNameError, match=says):
        motiondeck.Deck(**wrong)


def test_a_rate_or_a_start_that_cannot_be_is_refused():
    with pytest.raises(MotiondeckError):
        new_deck(rate=0.0)
    with pytest.raises(MotiondeckError, match="has 24 joints"):
        new_deck(start=[0.0])


def test_a_shipped_robot_plays_a_shipped_library():
    robot = motiondeck.load_robot("servo20")
    deck = motiondeck.Deck("thesis15", robot=robot)
    assert deck.joints == robot.joints
    for _ in range(20):
        q = deck.step(0.01)
    assert (q.shape, q.dtype) == ((20,), np.float64)
