"""The order and the times of cues, in virtual time, and what a deck gets that has missed some."""

import pytest

from controller.wire.messages.command_table import parse_command
from motiondeck.shows.cue_list import CueList, cue_named
from motiondeck.shows.messages import CommonRound, TimedCue
from motiondeck.shows.seen_decks import CueSum
from motiondeck.shows.show_file import ShowCue
from motiondeck_base.errors import UnknownNameError

LEAD = 0.5


def played(cues, until, holds=lambda *_: False, happening=None, first=0):
    """When each cue is sent, and for which time."""
    ticks = CueList(cues, LEAD, 0.0, first)
    happening, out = dict(happening or {}), []
    for tick in range(round(until * 100)):
        now = tick / 100
        for at in [at for at in happening if at <= now]:
            happening.pop(at)(ticks, now)
        while (due := ticks.due(now, lambda condition, cue, now=now: holds(now))) is not None:
            out.append((due[1].name, pytest.approx(now, abs=0.02), pytest.approx(due[2], abs=0.02)))
    return out


def go(cues, now):
    assert cues.go(now)


def cue(name, **more):
    return ShowCue(say="pause", name=name, **more)


def test_timed_cues_are_sent_ahead_of_their_times():
    assert played([cue("a", at=0.0), cue("b", at=2.0)], 4.0) == [("a", 0.0, 0.5), ("b", 2.0, 2.5)]


def test_a_hold_point_waits_and_times_count_from_it():
    cues = [cue("a", at=0.0), cue("b", hold=True), cue("c", at=1.0)]
    assert played(cues, 9.0) == [("a", 0.0, 0.5)]
    assert played(cues, 9.0, happening={5.0: go})[1:] == [("b", 5.0, 5.5), ("c", 6.0, 6.5)]


def test_a_condition_waits_until_it_holds():
    cues = [cue("a", at=0.0), cue("b", when="settled"), cue("c", at=1.0)]
    sent = played(cues, 9.0, holds=lambda now: now >= 3.0)
    assert sent[1:] == [("b", 3.0, 3.5), ("c", 4.0, 4.5)]


def test_a_condition_that_does_not_come_true_becomes_a_hold_point():
    cues = [cue("b", when="settled", within=2.0)]
    assert played(cues, 9.0, holds=lambda now: now > 4.0) == []
    assert played(cues, 9.0, happening={5.0: go}) == [("b", 5.0, 5.5)]


def test_hold_stops_before_a_timed_cue_which_then_comes_at_once():
    cues = [cue("a", at=0.0), cue("b", at=2.0), cue("c", at=3.0)]
    sent = played(cues, 9.0, happening={1.0: lambda cues, _: cues.hold(), 6.0: go})
    assert sent[1:] == [("b", 6.0, 6.5), ("c", 7.0, 7.5)]


def test_a_show_can_begin_later():
    cues = [cue("a", at=0.0), cue("b", at=20.0), cue("c", at=21.0)]
    assert played(cues, 4.0, first=cue_named(cues, "b")) == [("b", 0.0, 0.5), ("c", 1.0, 1.5)]
    assert cue_named(cues, "3") == 2
    with pytest.raises(UnknownNameError):
        cue_named(cues, "d")


def test_who_joins_late_gets_what_still_matters():
    cues = CueSum()
    says = [["switch walk", "tempo 2"], ["pause"], ["switch jog"], ["jump 0.5", "input speed 1"], ["pause"], ["resume"]]
    for number, lines in enumerate(says, start=1):
        step = CommonRound(10.0, 1.5) if number == 3 else None
        cues.take(TimedCue("run", number, "", float(number), ["left"], [parse_command(s.split()) for s in lines], step))
    joined = cues.cue("run", "left", 99.0)
    assert [type(command).__name__ for command in joined.say] == ["Switch", "SetInput", "Resume"]
    assert (joined.say[0].to, joined.number, joined.at, joined.step) == ("jog", 6, 99.0, CommonRound(10.0, 1.5))
