"""A deck that runs ahead of its joints keeps locks where the joints are, not where the deck is."""

import numpy as np
import pytest

from controller.deck.locks.phase_lock import wrapped
from controller.wire.leader_link import Sighting
from wheel import DT, ROUND, Wheel

LEAD = 0.07
BEAT = ROUND / 2.0


def errors_at_the_shaft(source, clock, seconds=6.0):
    """How far the shafts, which show each phase LEAD after the deck, are behind what is followed, s, in each tick."""
    deck, began = Wheel(0.3), 1000.0 if clock else 0.0
    now = began

    def look(_):
        return Sighting(now, (now / ROUND) % 1.0, 1.0 / ROUND)

    deck.due, deck.leader, deck.lead = (lambda: now) if clock else None, look, LEAD
    deck.lock(source, steps=2 if source == "beat" else 0)
    phases, beats = [], [began + BEAT * n for n in range(40)]
    for tick in range(round(seconds / DT)):
        now = began + (tick + 1) * DT
        while source == "beat" and beats[0] <= now:
            deck.beat(now - beats.pop(0))
        deck.update(DT)
        phases.append(deck.phase)
        assert deck.phase_at is None or deck.phase_at == pytest.approx(now + LEAD)
    late = round(LEAD / DT)
    times = began + (np.arange(len(phases)) + 1 + late) * DT
    modulus = 0.5 if source == "beat" else 1.0
    due = (times - began) / ROUND if source == "beat" else times / ROUND
    return np.array([wrapped(one, modulus) for one in due - phases]) * ROUND


@pytest.mark.parametrize("clock", [True, False])
def test_a_beat_is_met_at_the_shaft(clock):
    assert np.abs(errors_at_the_shaft("beat", clock)[-100:]).max() < 0.002 + (0.0 if clock else DT)


def test_another_deck_is_met_at_the_shaft():
    assert np.abs(errors_at_the_shaft("deck", True)[-100:]).max() < 0.001
