"""A deck falls in step with another one from any offset, over the socket too, and outlives it."""

from contextlib import closing

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.deck.locks.phase_lock import wrapped
from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.leader_link import LeaderLink, Sighting
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.replies import PhaseNow
from motiondeck_base.errors import MotiondeckError
from wheel import DT, Wheel


def seen_late(leader, generator):
    """What a link sees of a deck: every 50 ms, at a time that is known to half a tick."""
    ticks = iter(range(10**6))

    def look(time):
        if next(ticks) % 10:
            return None
        return Sighting(time + generator.uniform(-0.5, 0.5) * DT, leader.phase, leader.tempo / leader.seconds)

    return look


def follow(leader, follower, seconds):
    """The follower's error at each tick, s."""
    errors = []
    for _ in range(round(seconds / DT)):
        leader.update(DT)
        follower.update(DT)
        errors.append(wrapped(leader.phase - follower.phase) * leader.seconds)
    return np.array(errors)


@settings(max_examples=10)
@given(st.floats(0.0, 1.0, exclude_max=True), st.floats(0.7, 4.0), st.integers(0, 2**32 - 1))
def test_from_any_offset_two_decks_are_in_step_within_two_seconds(offset, seconds, seed):
    leader, follower = Wheel(0.3, seconds), Wheel((0.3 + offset) % 1.0, seconds)
    follower.leader = seen_late(leader, np.random.default_rng(seed))
    follower.lock("deck")
    errors = follow(leader, follower, 3.0)
    assert np.abs(errors[400:]).max() < 0.02
    assert follower.lock_state.state == "locked"
    assert follower.jumps <= 1


def test_it_follows_the_tempo_a_pause_and_another_length_of_the_round():
    leader, follower = Wheel(0.0, 1.0), Wheel(0.4, 1.4)
    follower.leader = seen_late(leader, np.random.default_rng(1))
    follower.lock("deck", phase=0.5)
    follow(leader, follower, 2.0)
    for tempo in (1.5, 0.5, -1.0):
        leader.set_tempo(tempo)
        follow(leader, follower, 4.0)
        assert abs(wrapped(leader.phase + 0.5 - follower.phase)) < 0.02
        assert follower.tempo == pytest.approx(1.4 * tempo, abs=0.1)
    leader.pause()
    follow(leader, follower, 3.0)
    assert abs(follower.tempo) < 0.05
    assert abs(wrapped(leader.phase + 0.5 - follower.phase)) < 0.01


def test_over_the_socket_the_phase_is_asked_and_a_deck_that_is_gone_is_outlived():
    leader, follower = Wheel(0.0, 1.0), Wheel(0.45, 1.0)
    server = CommandServer(0)
    with closing(CommandClient(server.port)) as client:
        follower.leader = LeaderLink(client)
        follower.lock("deck")
        for _ in range(500):
            for message, sender in server.poll():
                server.reply(sender, PhaseNow("walk", leader.phase, leader.tempo, message.id))
            leader.update(DT)
            follower.update(DT)
        assert abs(wrapped(leader.phase - follower.phase)) < 0.015
        assert follower.lock_state.state == "locked"
        server.close()
        for _ in range(400):
            follower.update(DT)
        assert follower.lock_state.state == "searching"
        assert follower.tempo == pytest.approx(1.0, abs=0.05)


def test_what_is_no_deck_is_refused():
    for address in ("moon", "0", "70000", "1.5", ""):
        with pytest.raises(CommandError, match="is nothing to lock to: give beat, body, or the command port"):
            LeaderLink.to(address)
    with pytest.raises(MotiondeckError, match="sees no other deck; start it with: motiondeck play --lock-to PORT"):
        Wheel().lock("deck")
