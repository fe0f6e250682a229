import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from controller.deck.deck import MOST_QUEUED, Deck
from controller.deck.performance import JOININGS
from controller.library.motion_library import load_library
from controller.wire.messages.arguments import TEMPO
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import shipped_configs

DT = 0.005


@pytest.fixture(scope="module")
def library():
    return synthetic.small_library()


def bone_directions(pose):
    """A stand-in for a robot: its joints are the bones' directions."""
    return pose.rotation.ravel().copy()


def new_deck(library, motion="march"):
    return Deck(library, bone_directions, motion)


def joints(library, deck, seconds):
    """Joint positions while the deck plays on, shape (ticks, joints, 3), m."""
    poses = []
    for _ in range(round(seconds / DT)):
        deck.update(DT)
        poses.append((deck.pose.root_position.copy(), deck.pose.rotation.copy()))
    roots, rotations = map(np.array, zip(*poses, strict=True))
    return library.skeleton.joints(roots, rotations)


def peak_acceleration(places):
    return np.linalg.norm(np.diff(places, n=2, axis=0), axis=-1).max() / DT**2


@pytest.fixture(scope="module")
def own_peak(library):
    """The largest acceleration of each motion by itself."""
    return {name: peak_acceleration(joints(library, new_deck(library, name), 2.0)) for name in synthetic.MOTIONS}


def moment(seconds):
    """A time that is on record by now."""
    assert seconds is not None
    return seconds


def test_it_walks_forward_as_fast_as_recorded(library):
    deck = new_deck(library)
    joints(library, deck, 4.0)
    assert deck.pose.root_position[0] == pytest.approx(1.2 * 4.0, rel=0.1)


@pytest.mark.parametrize("pair", [(a, b) for a in synthetic.MOTIONS for b in synthetic.MOTIONS])
def test_a_switch_neither_jumps_nor_freezes(library, own_peak, pair):
    source, target = pair
    deck = new_deck(library, source)
    joints(library, deck, 0.53)
    deck.switch(target, direct=True)
    places = joints(library, deck, 2.5)
    assert peak_acceleration(places) <= 2.0 * max(own_peak[source], own_peak[target], 5.0)
    assert deck.settled
    assert deck.motion == target
    if target != "bow":
        assert np.abs(np.diff(places[-50:], axis=0)).max() > 1e-4


def test_a_switch_is_on_record(library):
    deck = new_deck(library)
    joints(library, deck, 0.5)
    record = deck.switch("wave")
    assert (record.to, record.commanded_s) == ("wave", pytest.approx(0.5))
    joints(library, deck, 2.5)
    assert record.first_change_s is not None
    assert record.first_change_s - record.commanded_s <= 2.01 * DT
    assert record.settled_s is not None
    assert record.first_change_s < record.settled_s < 2.5


def test_a_switch_to_what_plays_changes_nothing(library):
    first, second = new_deck(library), new_deck(library)
    joints(library, first, 0.4)
    joints(library, second, 0.4)
    assert second.switch("march").settled_s == second.time
    assert np.array_equal(joints(library, first, 0.3), joints(library, second, 0.3))


def test_a_motion_that_happens_once_can_be_repeated(library):
    deck = new_deck(library, "bow")
    low = joints(library, deck, 3.0)[-1, 0, 2]
    deck.switch("bow")
    again = joints(library, deck, 3.0)[:, 0, 2]
    assert again.max() > low + 0.05
    assert again[-1] == pytest.approx(low, abs=0.03)


def ticks_until(deck, condition, most=4000):
    """How many updates it takes until the condition holds."""
    for tick in range(most):
        if condition():
            return tick
        deck.update(DT)
    raise AssertionError("it never does")


def test_a_switch_waits_for_the_end_of_a_motion_that_happens_once(library):
    deck = new_deck(library, "bow")
    joints(library, deck, 0.3)
    switch = deck.switch("march")
    assert switch.after == "bow"
    joints(library, deck, 0.5)
    assert switch.first_change_s is None
    assert not deck.settled
    low = deck.pose.root_position[2]
    ticks_until(deck, lambda: switch.first_change_s is not None)
    assert deck.pose.root_position[2] < low - 0.05
    ticks_until(deck, lambda: deck.settled)
    assert switch.settled_s is not None
    assert not switch.overtaken


def test_said_to_be_direct_a_switch_waits_for_nothing(library):
    deck = new_deck(library, "bow")
    joints(library, deck, 0.3)
    switch = deck.switch("march", direct=True)
    joints(library, deck, 2.01 * DT)
    assert switch.first_change_s is not None
    always = Deck(library, bone_directions, "bow", direct=True)
    assert always.switch("march").after == ""


def test_what_is_queued_is_played_after_each_round(library):
    deck = new_deck(library)
    joints(library, deck, 0.3)
    first, second = deck.enqueue("wave"), deck.enqueue("march")
    assert deck.queue == ["wave", "march"]
    ticks_until(deck, lambda: first.settled_s is not None)
    assert first.first_change_s == pytest.approx(0.8, abs=0.05)  # 96 frames at 120 Hz
    assert second.first_change_s is None
    ticks_until(deck, lambda: second.settled_s is not None)
    assert moment(second.first_change_s) - moment(first.first_change_s) > 0.98
    assert (deck.motion, deck.queue) == ("march", [])


def test_a_loop_that_has_gone_round_often_ends_its_present_round_first(library):
    deck = new_deck(library)
    joints(library, deck, 3.0)
    switch = deck.enqueue("wave")
    ticks_until(deck, lambda: switch.first_change_s is not None)
    assert switch.first_change_s == pytest.approx(3.2, abs=0.05)


def test_the_same_motion_can_be_queued_twice(library):
    deck = new_deck(library, "bow")
    again = [deck.enqueue("bow"), deck.enqueue("bow")]
    ticks_until(deck, lambda: again[1].settled_s is not None)
    assert moment(again[0].settled_s) < moment(again[1].first_change_s)


def test_a_switch_forgets_what_was_queued_and_what_was_under_way(library):
    deck = new_deck(library)
    joints(library, deck, 0.2)
    queued, first = deck.enqueue("bow"), deck.switch("wave")
    joints(library, deck, 0.1)
    second = deck.switch("march")
    assert (queued.overtaken, first.overtaken, second.overtaken) == (True, True, False)
    joints(library, deck, 3.0)
    assert deck.motion == "march"
    assert queued.first_change_s is None
    assert first.settled_s is None


def test_asked_for_again_a_switch_under_way_goes_on(library):
    deck = new_deck(library)
    joints(library, deck, 0.2)
    first = deck.switch("wave")
    joints(library, deck, 0.1)
    assert deck.switch("wave") is first


def test_a_queue_has_its_bounds(library):
    deck = new_deck(library)
    for _ in range(MOST_QUEUED):
        deck.enqueue("wave")
    with pytest.raises(MotiondeckError, match="queue is full"):
        deck.enqueue("wave")
    with pytest.raises(UnknownNameError, match="march"):
        new_deck(library).enqueue("marsh")


def test_a_change_of_tempo_takes_the_time_it_is_given(library):
    deck = new_deck(library)
    deck.set_tempo(2.0, over=2.0)
    joints(library, deck, 1.0)
    assert deck.tempo == pytest.approx(1.5)
    joints(library, deck, 1.1)
    assert deck.tempo == 2.0
    with pytest.raises(MotiondeckError, match="SECONDS must be"):
        deck.set_tempo(1.0, over=-1.0)


def test_a_pause_stands_still_and_a_resume_goes_on(library):
    deck = new_deck(library)
    joints(library, deck, 0.5)
    deck.pause()
    joints(library, deck, 0.5)
    assert np.ptp(joints(library, deck, 0.5), axis=0).max() < 1e-9
    deck.resume()
    assert np.ptp(joints(library, deck, 1.0), axis=0).max() > 0.3


def test_half_the_tempo_takes_twice_the_time(library):
    deck = new_deck(library)
    deck.set_tempo(0.5)
    joints(library, deck, 1.0)
    start = deck.pose.root_position[0]
    joints(library, deck, 2.0)
    assert deck.pose.root_position[0] - start == pytest.approx(1.2, rel=0.1)


@pytest.mark.parametrize("factor", [TEMPO.lowest * 1.1, TEMPO.highest * 2, float("nan"), float("inf")])
def test_an_impossible_tempo_is_refused(library, factor):
    with pytest.raises(MotiondeckError, match="TEMPO must be"):
        new_deck(library).set_tempo(factor)


def test_an_unknown_motion_is_refused_with_the_nearest_name(library):
    deck = new_deck(library)
    with pytest.raises(UnknownNameError, match="wave"):
        deck.switch("wavee")
    assert not deck.switches
    with pytest.raises(UnknownNameError, match="march"):
        new_deck(library, "marsh")


@settings(max_examples=16, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(1, 60),
            st.sampled_from([*synthetic.MOTIONS, "queue bow", "queue wave", "blend", "pause", "resume", 0.1, 0.5, 3.0]),
        ),
        max_size=8,
    )
)
def test_whatever_is_commanded_targets_are_finite_and_repeatable(library, commands):
    runs = []
    for _ in range(2):
        deck, targets = new_deck(library), []
        for ticks, command in commands:
            if command == "blend":
                deck.blend_in("march", "wave", 0.1 * (ticks % 11))
            elif command == "pause":
                deck.pause()
            elif command == "resume":
                deck.resume()
            elif isinstance(command, str) and command.startswith("queue "):
                deck.enqueue(command[6:])
            elif isinstance(command, float):
                deck.set_tempo(command)
            else:
                deck.switch(command)
            targets += [deck.update(DT)[0] for _ in range(ticks)]
        runs.append(np.array(targets))
    assert np.isfinite(runs[0]).all()
    assert np.array_equal(runs[0], runs[1])


def lose(deck, z):
    """Puts the network into a state of another motion or of none."""
    part, bound, was = deck.performance.tracks.playing[0].guard.network.snapshot()
    deck.performance.tracks.playing[0].guard.network.restore((part, bound, np.broadcast_to(np.float32(z), was.shape)))


@pytest.mark.parametrize("motion", list(synthetic.MOTIONS))
def test_a_network_that_runs_well_is_left_alone(library, motion):
    deck = new_deck(library, motion)
    joints(library, deck, 5.0)
    assert deck.restarts == 0


@pytest.mark.parametrize("nonsense", [np.nan, 1e6])
@pytest.mark.parametrize("motion", ["march", "bow"])
def test_a_lost_network_is_brought_back_smoothly(library, own_peak, motion, nonsense):
    deck = new_deck(library, motion)
    joints(library, deck, 0.3)
    lose(deck, nonsense)
    places = joints(library, deck, 3.0)
    assert np.isfinite(places).all()
    assert peak_acceleration(places) <= 2.0 * max(own_peak[motion], 5.0)
    assert deck.restarts == 1
    assert deck.motion == motion
    assert deck.settled


def test_a_network_that_froze_starts_again(library, monkeypatch):
    deck = new_deck(library, "march")
    joints(library, deck, 0.3)
    stuck = deck.performance.tracks.playing[0].player._frames[3].copy()
    guard = deck.performance.tracks.playing[0].guard
    assert guard is not None
    with monkeypatch.context() as frozen:
        frozen.setattr(guard.network, "advance", lambda out: np.copyto(out, stuck))
        joints(library, deck, 2.0)
    assert deck.restarts >= 1
    assert np.abs(np.diff(joints(library, deck, 2.0)[-50:], axis=0)).max() > 1e-4
    assert deck.settled


def test_a_centralized_library_needs_no_guard():
    library = load_library(shipped_configs() / "libraries" / "cmu86.safetensors")
    deck = Deck(library, bone_directions, library.network.motions[0])
    deck.update(DT)
    assert deck.restarts == 0


def test_a_blend_lies_between_its_motions(library):
    deck = new_deck(library)
    joints(library, deck, 0.5)
    record = deck.blend_in("march", "wave", 0.5)
    places = joints(library, deck, 2.0)
    assert deck.settled
    assert moment(record.settled_s) - record.commanded_s == pytest.approx(0.5, abs=0.05)
    assert deck.blend == (("wave", 0.5),)
    assert (deck.motion, deck.playing) == ("march", "march")
    assert np.abs(np.diff(places[-50:], axis=0)).max() > 1e-3
    alone = [np.ptp(joints(library, new_deck(library, m), 1.0)[:, 0, 0]) for m in ("march", "wave")]
    assert min(alone) < np.ptp(places[-200:, 0, 0]) < max(alone)


def test_a_blend_plays_its_first_motion_before(library):
    deck = new_deck(library, "wave")
    joints(library, deck, 0.3)
    record = deck.blend_in("march", "wave", 0.25)
    ticks_until(deck, lambda: record.settled_s is not None)
    assert (deck.playing, deck.blend) == ("march", (("wave", 0.25),))


@pytest.mark.thorough
@pytest.mark.parametrize(("share", "left"), [(1.0, "wave"), (0.0, "march")])
def test_the_share_of_a_blend_can_be_moved_and_at_its_ends_one_motion_is_left(library, share, left):
    deck = new_deck(library)
    deck.blend_in("march", "wave", 0.5)
    joints(library, deck, 1.0)
    deck.blend_in("wave", "march", 0.6)  # the same two the other way round
    joints(library, deck, 1.0)
    assert deck.blend == (("wave", pytest.approx(0.4)),)
    record = deck.blend_in("march", "wave", share)
    ticks_until(deck, lambda: record.settled_s is not None)
    joints(library, deck, 0.1)
    assert (deck.playing, deck.blend) == (left, ())
    joints(library, deck, 2.0)
    assert deck.restarts == 0


@pytest.mark.parametrize("commands", [("switch", 0.5), (0.3, 0.2)])
def test_a_blend_commanded_while_its_first_motion_is_faded_in_is_carried_out(library, commands):
    """The deck waited for ever, and with it all that was queued."""
    first, share = commands
    deck = new_deck(library, "wave")
    joints(library, deck, 0.4)
    if first == "switch":
        deck.switch("march")
    else:
        deck.blend_in("march", "wave", first)
    joints(library, deck, 0.1)
    record = deck.blend_in("march", "wave", share)
    ticks_until(deck, lambda: record.settled_s is not None)
    assert deck.blend == (("wave", pytest.approx(share)),)
    assert deck.settled


@pytest.mark.thorough
@pytest.mark.parametrize("to", synthetic.MOTIONS)
def test_a_switch_leaves_a_blend(library, to):
    deck = new_deck(library)
    deck.blend_in("march", "wave", 0.5)
    joints(library, deck, 1.2)
    deck.switch(to)
    places = joints(library, deck, 3.0)
    assert (deck.playing, deck.blend, deck.settled) == (to, (), True)
    assert np.isfinite(places).all()


def test_a_blend_that_another_command_overtakes_never_settles(library):
    deck = new_deck(library)
    record = deck.blend_in("march", "wave", 0.9)
    joints(library, deck, 0.2)
    deck.switch("wave")
    joints(library, deck, 3.0)
    assert record.overtaken
    assert record.settled_s is None
    assert (deck.playing, deck.blend) == ("wave", ())


@pytest.mark.parametrize(
    ("first", "second", "share", "why"),
    [
        ("march", "bow", 0.5, "bow is a one-shot"),
        ("march", "march", 0.5, "two motions"),
        ("march", "wave", 1.5, "WEIGHT must be a number from -0.3 to 1.3"),
        ("march", "wave", float("nan"), "WEIGHT must be a number from -0.3 to 1.3"),
        ("march", "wavee", 0.5, "wave"),
    ],
)
def test_what_cannot_be_blended_is_refused(library, first, second, share, why):
    with pytest.raises(MotiondeckError, match=why):
        new_deck(library).blend_in(first, second, share)


@pytest.mark.thorough
@pytest.mark.parametrize("joining", JOININGS)
@pytest.mark.parametrize("to", ["wave", "bow"])
def test_however_motions_are_joined_the_target_is_played_in_the_end(library, joining, to):
    deck = Deck(library, bone_directions, "march", joining=joining)
    joints(library, deck, 0.53)
    record = deck.switch(to)
    assert np.isfinite(joints(library, deck, 4.0)).all()
    assert (deck.playing, deck.blend, deck.settled) == (to, (), True)
    assert record.commanded_s < moment(record.first_change_s) <= moment(record.settled_s) < 3.0
    if to == "bow":
        held = joints(library, deck, 0.5)
        assert np.ptp(held, axis=0).max() < 0.02


def test_a_motion_is_entered_where_it_moves_as_the_body_does(library):
    """Arms that swing pass each place twice; the place alone would not tell which way they go."""
    opposite = []
    for seconds in (0.34, 0.4, 0.46, 0.74, 0.8, 0.86):  # in the middle of a swing
        deck = new_deck(library)
        joints(library, deck, seconds)
        show = deck.performance
        velocities = show.motions["march"].velocities
        forwards, backwards = (
            show._best_anchor("march", *postures)
            for postures in ((show._before, show.posture), (show.posture, show._before))
        )
        opposite.append(velocities[forwards] @ velocities[backwards] < 0.0)
    assert all(opposite)


def test_what_happens_is_told_in_order(library):
    deck = new_deck(library)
    deck.switch("wave")
    deck.switch("bow")
    ticks_until(deck, lambda: deck.settled)
    assert [(event.kind, event.motion) for event in deck.events] == [
        *(("motion", "wave"), ("overtaken", "wave"), ("motion", "bow"), ("settled", "bow")),
    ]
    assert [event.at for event in deck.events] == sorted(event.at for event in deck.events)
    deck.events.clear()
    deck.blend_in("march", "wave", 0.5)
    ticks_until(deck, lambda: deck.settled)
    deck.plan.give_up_blend("stands still", deck.time)
    told = {event.kind: event.text for event in deck.events}
    assert told["settled"].startswith("march with 0.50 of wave after")
    assert told["gave up"] == "march with 0.50 of wave stands still, fell back to march"
