"""What a switch adds to a tick: its work is counted, not timed, in every tick from the command until it has settled."""

import sys

import pytest

import controller.deck.performance as performance
from controller.deck.deck import Deck
from controller.deck.joins import blend_weight, fade_search
from shipped_libraries import shipped

RATE = 200.0
MOST_CALLS = 400  # of Python functions in an update; one that plays on makes 40, and one of a blend 220


@pytest.fixture(scope="module", params=["thesis15", "cmu86"])
def library(request):
    return shipped(request.param)


@pytest.fixture
def work(monkeypatch):
    """What was done since it was last emptied, by name."""
    done = []

    def noting(owner, name):
        call = getattr(owner, name)

        def noted(*args, **kwargs):
            done.append(name)
            return call(*args, **kwargs)

        monkeypatch.setattr(owner, name, noted)

    noting(fade_search, "peaks")
    noting(blend_weight, "crossed")
    noting(performance, "difference")
    noting(performance, "entry_costs")
    return done


def switched(library, source, target, joining, phase, each):
    """Plays a switch, and calls `each` with what updates the deck once."""
    deck = Deck(library, lambda pose: pose.root_position, source, direct=True, joining=joining, phase=phase)
    for _ in range(20):
        deck.update(1.0 / RATE)
    switch = deck.switch(target)
    while switch.settled_s is None:
        each(lambda: deck.update(1.0 / RATE))


def pairs_of(library):
    names = library.network.motions
    return [(names[k], names[(k + 4) % len(names)], 0.13 * k % 1.0) for k in range(0, len(names), 2)]


@pytest.mark.thorough
@pytest.mark.parametrize("joining", [None, "crossfade"])
def test_no_tick_of_a_switch_does_two_heavy_things(library, work, joining):
    looks = []

    def tick(update):
        work.clear()
        update()
        looks.append(len({"peaks", "crossed"} & {*work}))
        assert len(work) <= 1, work

    for source, target, phase in pairs_of(library)[:4]:
        switched(library, source, target, joining, phase, tick)
    assert sum(looks) or (joining is None and library.info.name == "cmu86")  # its module morphs


@pytest.mark.thorough
@pytest.mark.parametrize("joining", [None, "crossfade"])
def test_no_tick_of_a_switch_makes_many_calls(joining):
    library, calls = shipped(), 0

    def count(frame, event, argument):
        nonlocal calls
        calls += event == "call"

    def tick(update):
        nonlocal calls
        calls, before = 0, sys.getprofile()
        sys.setprofile(count)
        try:
            update()
        finally:
            sys.setprofile(before)
        assert calls <= MOST_CALLS

    for source, target, phase in pairs_of(library)[:3]:
        switched(library, source, target, joining, phase, tick)
