"""`play --recognizer`: a saved recognizer that has seen three people says which motion the deck plays."""

import re

import pytest

import recognition_examples as examples
import synthetic
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.learning.recognition.experts import STRETCHED_LEAK, STRETCHES, ExpertRecipe
from controller.learning.recognition.features import FeatureRecipe
from controller.learning.recognition.recognizer import load_recognizer, save_recognizer, train_recognizer
from controller.loop.commands.command_handler import CommandHandler
from controller.wire.messages.commands import SetTempo, Switch
from motiondeck.run.assembly import open_session
from motiondeck.run.recognition.watches import BodyWatch
from motiondeck.run.report import summary
from motiondeck.run.robots.robot_on_deck import open_robots
from motiondeck.run.session import Host, Played
from motiondeck.run.spec.program import Timed
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A committee of three people's marches, waves and bows; the deck's body is none of theirs."""
    out = tmp_path_factory.mktemp("recognizer") / "gestures.safetensors"
    experts = ExpertRecipe(neurons=64, groups=4, leak=STRETCHED_LEAK)
    save_recognizer(train_recognizer(examples.dataset(takes=1), FeatureRecipe(), experts, STRETCHES), out)
    return out


@pytest.fixture(scope="module")
def library():
    return synthetic.small_phase_library()


def session(library, recognizer, seconds, timeline=()):
    """A run of the mannequin at 100 Hz on a virtual clock that begins with march."""
    spec = RunSpec(physics=False, rate=100.0, seconds=seconds, recognizer=recognizer)
    played = Played(
        library,
        lambda opening: open_robots(opening, spec, library),
        lambda retarget: Deck(library, retarget, "march"),
        timeline,
    )
    return open_session(spec, played, Host(clock=VirtualClock(100.0)))


def test_what_the_deck_plays_is_recognized_and_reported(library, file, monkeypatch):
    timeline = [Timed(3.0, Switch(to="wave"))]
    events = []
    notify = CommandHandler.notify
    monkeypatch.setattr(CommandHandler, "notify", lambda self, *event: (events.append(event), notify(self, *event)))
    with session(library, str(file), 6.0, timeline) as run:
        report = run.run()
    recognized = [motion for kind, _, *motion in events if kind == "recognized"]
    assert recognized == [["march"], ["wave"]]
    assert re.fullmatch(
        r"it looks like march \(confidence 0\.\d\d\)", next(e[1] for e in events if e[0] == "recognized")
    )
    first = {one["motion"]: one["at"] for one in reversed(report["recognition"]["seen"])}
    assert first.keys() <= {"march", "wave", None}
    assert 0.0 < first["march"] < 1.0
    assert 3.0 < first["wave"] < 5.0
    assert "while march was played, march (" in summary(report)


@pytest.mark.parametrize("tempo", [0.5, 2.0])
def test_it_is_recognized_at_half_and_at_twice_the_tempo(library, file, tempo):
    with session(library, str(file), 5.0, [Timed(0.0, SetTempo(factor=tempo))]) as run:
        shares = run.run()["recognition"]["shares"]["march"]
    assert shares["march"] > 0.5
    assert shares.get("wave", 0.0) + shares.get("bow", 0.0) == 0.0


def test_a_body_without_the_joints_is_refused_before_anything_moves(file):
    stranger = synthetic.small_skeleton()
    bones = tuple(f"part{n}" for n in range(len(stranger)))
    other = type(stranger)("stranger", bones, stranger.parent, stranger.rest_direction, stranger.length)
    with pytest.raises(MotiondeckError, match="no bone rhip, rleg"):
        BodyWatch(load_recognizer(file), other)
