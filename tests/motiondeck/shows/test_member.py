"""A deck's part in a show, on a clock of its own: cues reach the deck ahead of their time, questions are irregular."""

from contextlib import ExitStack, closing

import numpy as np
import pytest

from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.messages.commands import (
    AtTime,
    EmergencyStop,
    GetPhase,
    LockPhase,
    Reset,
    ServoTorque,
    SetTempo,
    Switch,
    Unlock,
)
from controller.wire.messages.replies import PhaseNow
from motiondeck.shows.member import ASKS_EVERY, Member
from motiondeck.shows.messages import About, CommonRound, EmergencyStopAll, Time, TimedCue, encode
from waiting import PATIENCE

AHEAD = 500.0  # s by which the conductor's clock is ahead


class Link:
    """Answers at once, by a clock that is ahead."""

    def __init__(self, now):
        self.now, self.heard, self.asked, self.there = now, {}, [], True
        self.stops = []

    def subscribe(self, key, heard):
        self.heard[key] = heard

    def answer(self, key, answer):
        pass

    def announce(self, key):
        pass

    def publish(self, key, data):
        pass

    def ask(self, key, heard, patience):
        if not self.there:
            return
        self.asked.append(self.now())
        heard(key, encode(Time("run", self.now() + AHEAD, "go on", 3.0, self.stops)))

    def close(self):
        pass


class Stage:
    """A member, the sockets of its deck, and a time that is told."""

    def __init__(self, opened, *, conducted=True):
        self.time = 1000.0
        self.deck = opened.enter_context(closing(CommandServer(0)))
        leader = opened.enter_context(closing(CommandServer(0)))
        client = opened.enter_context(closing(CommandClient(self.deck.port)))
        self.asking = opened.enter_context(closing(CommandClient(leader.port)))
        self.link, self.told = Link(lambda: self.time), []
        self.link.there = conducted
        about = About("dummy", "small", 100.0, {"march": 0.9})
        self.member = Member("left", about, self.link, client, leader, self.told.append, lambda: self.time)
        opened.callback(self.member.close)
        self.play(3.0)

    def play(self, seconds):
        """What the deck is told meanwhile, and when."""
        told = []
        for _ in range(round(seconds / 0.01)):
            self.time += 0.01
            self.member.step(0.0)
            told += [(self.time, message) for message, _ in self.deck.poll()]
        return told

    def cue(self, number, at, *say, step=None):
        """A cue of the conductor, for a time of the deck's clock."""
        cue = TimedCue("run", number, f"scene {number}", at + AHEAD, ["left"], list(say), step)
        self.link.heard["cue"]("cue", encode(cue))

    def phase(self):
        """What the deck is answered for the phase of the show."""
        self.asking.post(GetPhase())
        self.member.step(0.0)
        return self.asking.receive(PATIENCE)


@pytest.fixture
def stage():
    with ExitStack() as opened:
        yield Stage(opened)


def timed(told):
    return [(message.when, message.say) for _, message in told if isinstance(message, AtTime)]


def test_a_cue_reaches_the_deck_ahead_with_its_time(stage):
    """The deck is punctual even where the member gets no core when the time comes."""
    at, step = stage.time + 0.5, CommonRound(stage.time + 0.5 + AHEAD, 0.9)
    stage.cue(1, at, Switch("march"), SetTempo(1.2), step=step)
    given = timed(stage.play(0.02))
    assert [say for _, say in given] == [Switch("march"), SetTempo(1.2), LockPhase("deck")]
    assert [when for when, _ in given] == pytest.approx([at] * 3, abs=1e-6)
    assert stage.phase().phase is None  # the show's phase begins with the cue
    stage.play(0.6)
    assert stage.phase().phase == pytest.approx((stage.time - at) / 0.9, abs=1e-6)


def test_a_phase_says_when_it_was(stage):
    stage.cue(1, stage.time, step=CommonRound(stage.time + AHEAD, 0.9))
    stage.play(0.1)
    now = stage.phase()
    assert isinstance(now, PhaseNow)
    assert now.at == stage.time
    assert now.rate == pytest.approx(1.0 / 0.9)


def test_a_motion_without_step_ends_the_lock_of_a_cue_that_is_still_to_come(stage):
    stage.cue(1, stage.time + 0.2, Switch("march"), step=CommonRound(stage.time + 0.2 + AHEAD, 0.9))
    stage.cue(2, stage.time + 0.4, Switch("march"))
    says = [say for _, say in timed(stage.play(0.05))]
    assert says == [Switch("march"), LockPhase("deck"), Unlock(), Switch("march")]
    stage.play(0.25)
    assert stage.phase().phase is not None
    stage.play(0.25)
    assert stage.phase().phase is None


def test_a_cue_that_comes_too_late_is_left_out_and_told(stage):
    stage.cue(1, stage.time - 0.1, Switch("march"))
    stage.cue(2, stage.time - 0.4, Switch("march"))
    assert len(timed(stage.play(0.05))) == 1
    assert stage.told[-1] == "scene 2 came 0.4 s late"


@pytest.mark.parametrize(
    ("command", "reason"),
    [(Reset(), "not for a show"), (ServoTorque("l_knee", "off"), "not for a show"), (SetTempo(99.0), "TEMPO must be")],
)
def test_a_cue_with_what_no_show_may_say_is_left_out_and_told(stage, command, reason):
    """Another member may send anything; what the conductor checks does not count here."""
    stage.cue(1, stage.time + 0.1, Switch("march"), command, step=CommonRound(stage.time + AHEAD, 0.9))
    assert timed(stage.play(0.5)) == []
    assert stage.told[-1].startswith("scene 1: ")
    assert reason in stage.told[-1]
    assert stage.phase().phase is None


def test_questions_come_at_irregular_times(stage):
    """Else they could meet the ticks of the decks on their way there, and never on their way back."""
    before = len(stage.link.asked)
    stage.play(60.0)
    between = np.diff(stage.link.asked[before:])
    assert between.mean() == pytest.approx(ASKS_EVERY, rel=0.1)
    assert between.std() > 0.03


def test_a_deck_that_hears_nothing_says_what_it_does(stage):
    stage.link.there = False
    stage.play(3.5)
    assert stage.told[-1] == "the conductor has not answered for 3 s; the deck plays on"


def test_a_deck_that_no_conductor_ever_answers_says_so_once_and_what_to_check():
    with ExitStack() as opened:
        stage = Stage(opened, conducted=False)
        stage.play(60.0)
        assert stage.told == [
            "no conductor is heard yet; the deck waits for one up to 10 s before it moves",
            "no conductor has answered for 10 s: does it run, with certificates of one authority?",
        ]
        stage.link.there = True
        stage.play(1.0)
        assert stage.told[2:] == ["the show has a conductor"]


def test_a_deck_does_not_move_before_a_conductor_that_is_late_has_told_it_of_a_stop():
    """Where a fifth of all packets is lost, a link of TCP and TLS may take several seconds to open."""
    with ExitStack() as opened:
        stage = Stage(opened, conducted=False)
        stage.play(6.5)
        assert stage.phase().reason == "the deck is still joining the show"
        stage.link.there, stage.link.stops = True, [EmergencyStopAll("right", "a1")]
        told = stage.play(0.4)  # the member's questions are up to 0.35 s apart
        assert any(isinstance(message, EmergencyStop) for _, message in told)
        stage.play(0.3)
        assert isinstance(stage.phase(), PhaseNow)


def test_a_deck_plays_on_its_own_after_ten_seconds_without_anyone():
    with ExitStack() as opened:
        stage = Stage(opened, conducted=False)
        stage.play(6.9)
        assert not isinstance(stage.phase(), PhaseNow)
        stage.play(0.2)
        assert isinstance(stage.phase(), PhaseNow)
