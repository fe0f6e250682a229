import os
import pty
import re
import select
import subprocess
import sys
import threading
from contextlib import closing

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.command_table import COMMANDS, parse_command
from controller.wire.messages.commands import (
    Blend,
    EmergencyStop,
    GetPhase,
    GetStatus,
    GiveBeat,
    Home,
    Jump,
    LockPhase,
    Pause,
    Queue,
    Reset,
    Resume,
    SetTempo,
    Stop,
    Subscribe,
    Switch,
    Unlock,
)
from controller.wire.messages.replies import Accepted, Refused, Settled, State
from motiondeck.run.terminal import describe, help_on, listen_to


def test_help_teaches_every_command_and_its_examples_are_commands():
    said = help_on(())
    for command in COMMANDS:
        assert f"\n{command.usage} " in said
    examples = re.findall(r"^  motiondeck send (.+?)(?: --wait)?  +\w", said, re.MULTILINE)
    assert [type(parse_command(line.split())) for line in examples] == [GetStatus, Switch, SetTempo, Pause, Stop]
    assert help_on(["tempo"]).startswith("motiondeck send tempo TEMPO [SECONDS]\n")
    with pytest.raises(CommandError, match=r"there is no command 'tepmo'\. Did you mean tempo"):
        help_on(["tepmo"])


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("waltz", Switch("waltz")),
        ("switch waltz", Switch("waltz")),
        ("switch pause", Switch("pause")),
        ("switch waltz direct", Switch("waltz", direct=True)),
        ("queue waltz", Queue("waltz")),
        ("blend walk jog 0.3", Blend("walk", "jog", 0.3)),
        ("tempo 1.5", SetTempo(1.5)),
        ("tempo 1.5 4", SetTempo(1.5, over=4.0)),
        ("tempo -0.5", SetTempo(-0.5)),
        ("jump 0.25", Jump(0.25)),
        ("beat", GiveBeat()),
        ("tap 0.1", GiveBeat(ago=0.1)),
        ("lock beat", LockPhase("beat")),
        ("lock beat 0.5 2", LockPhase("beat", phase=0.5, steps=2)),
        ("unlock", Unlock()),
        ("phase", GetPhase()),
        ("home", Home()),
        ("estop", EmergencyStop()),
        ("reset", Reset()),
        ("pause", Pause()),
        ("resume", Resume()),
        ("status", GetStatus()),
        ("stop", Stop()),
        ("quit", Stop()),
    ],
)
def test_words_become_messages(line, message):
    assert parse_command(line.split()) == message
    assert parse_command([line]) == message  # as a script passes a whole line


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("", "is not a command. `motiondeck send help` lists them."),
        ("tempoo 2 3", "'tempoo 2 3' is not a command. Did you mean tempo? `motiondeck send help`"),
        ("dance the waltz", "'dance the waltz' is not a command"),
        ("switch", "switch: give it as: switch MOTION [direct]"),
        ("switch walk jog", "'jog' is not understood here; leave it out or give: direct"),
        ("queue", "queue: give it as: queue MOTION"),
        ("blend walk jog", "blend: give it as: blend A B WEIGHT [C WEIGHT ...]"),
        ("blend walk jog much", "WEIGHT must be a number from -0.3 to 1.3, not 'much'"),
        ("blend walk jog 1.4", "WEIGHT must be a number from -0.3 to 1.3, not 1.4"),
        ("tempo", "tempo: give it as: tempo TEMPO [SECONDS]"),
        ("tempo 1 soon", "SECONDS must be a number from 0 to 60, not 'soon'"),
        ("tempo 1 100", "from 0 to 60, not 100"),
        ("tempo fast", "from -3 to 3, not 'fast'"),
        ("jump 1.1", "PHASE must be a number from 0 to 1, not 1.1"),
        ("lock", "lock: give it as: lock SOURCE [PHASE] [STEPS]"),
        ("lock moon", "SOURCE must be one of beat, deck, body, person, not 'moon'"),
        ("lock beat 0 1.5", "STEPS must be a whole number from 0 to 16, not '1.5'"),
        ("lock beat 0 17", "STEPS must be a whole number from 0 to 16, not 17"),
        ("beat 3", "AGO must be a number from -2 to 2, not 3"),
        ("tempo 9", "from -3 to 3, not 9"),
        ("tempo nan", "from -3 to 3, not nan"),
        ("pause now", "pause: give it as: pause"),
        ("x" * 101, "1 to 100 characters"),
    ],
)
def test_other_words_are_refused_with_what_may_be_said(line, said):
    with pytest.raises(CommandError, match=re.escape(said)):
        parse_command(line.split())


@given(st.lists(st.text(max_size=10), max_size=4))
def test_any_words_are_a_message_or_a_command_error(words):
    try:
        message = parse_command(words)
    except CommandError:
        return
    assert isinstance(message, Switch | Blend | SetTempo | Pause | Resume | GetStatus | Stop)


def test_replies_are_told_in_one_line():
    assert describe(Accepted(1)) == "accepted"
    assert describe(Accepted(1, "bow", ["standup"])) == "accepted, after bow, by way of standup"
    assert describe(State(motion="jog", motions=["jog"], paused=True, id=1, queue=["bow"], mode="home")) == (
        "home; playing jog, paused; next: bow; motions: jog"
    )
    assert describe(Refused("there is no jig", 1)) == "refused: there is no jig"
    assert describe(Settled("jog", 0.333, 1)) == "settled on jog after 0.33 s"
    assert describe(State(motion="jog", motions=["jog", "walk"], switching=True, id=1)) == (
        "switching to jog, at tempo 1.00; motions: jog, walk"
    )
    assert describe(State(motion="jog", motions=["jog"], tempo=-0.5, id=1, phase=0.25)) == (
        "playing jog, at tempo -0.50, phase 0.25; motions: jog"
    )
    assert describe(State(motion="jog", motions=["jog"], paused=True, id=1)) == "playing jog, paused; motions: jog"


class Answering:
    """A server that accepts everything, and lets switches settle at once, until it hears its last word.

    As a context it does so in a thread.
    """

    def __init__(self, last):
        self.server = CommandServer(0)
        self.heard = []
        self._last = last
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve)

    def answer(self):
        """Whether its last word was among what has arrived; it has closed then, and hears no more."""
        for message, sender in self.server.poll():
            self.heard.append(type(message))
            self.server.reply(sender, Accepted(message.id))
            if isinstance(message, Switch):
                self.server.reply(sender, Settled(message.to, 0.5, message.id))
            if isinstance(message, self._last):
                self.server.close()
                return True
        return False

    def _serve(self):
        while not self._stop.wait(0.002) and not self.answer():
            pass
        self.server.close()

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()


PROMPT = "\x1b[?25h"  # the cursor shown again, after the prompt was drawn
# The thread that answers may wait long for a core.
PATIENT = "from motiondeck.run import terminal; terminal._HEARTBEAT = terminal._STARTING = 30.0; terminal.main()"


class Typist:
    """A person at a terminal of their own: types, and waits for what appears."""

    def __init__(self, port):
        self.hand, far = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-c", PATIENT, str(port)],
            stdin=far,
            stdout=far,
            stderr=far,
            env={**os.environ, "TERM": "xterm", "PROMPT_TOOLKIT_NO_CPR": "1"},
            start_new_session=True,
        )
        os.close(far)
        self.seen = ""

    def wait_for(self, text):
        while text not in self.seen:
            assert select.select([self.hand], [], [], 30.0)[0], f"'{text}' never appeared in: {self.seen}"
            self.seen += os.read(self.hand, 4096).decode(errors="replace")
        self.seen = self.seen.split(text, 1)[1]

    def type(self, text):
        os.write(self.hand, text.encode())


def test_a_person_switches_by_name_and_the_prompt_ends_with_the_deck():
    with Answering(last=Stop) as deck:
        person = Typist(deck.server.port)
        person.wait_for("Type a motion's name")
        person.wait_for(PROMPT)
        person.type("jog\r")
        person.wait_for("accepted")
        person.wait_for("settled on jog after 0.50 s")
        person.wait_for(PROMPT)
        person.type("tempo 20\r")
        person.wait_for("from -3 to 3")
        person.wait_for(PROMPT)
        person.type("help\r")
        person.wait_for("switch to a motion")
        person.wait_for(PROMPT)
        person.type("\x03")
        person.wait_for("The deck has ended.")
        assert person.process.wait(30.0) == 0
        os.close(person.hand)
    assert (deck.heard[0], deck.heard[-1], Switch in deck.heard) == (GetStatus, Stop, True)


def test_with_no_deck_it_says_so_and_fails():
    server = CommandServer(0)
    server.close()
    person = Typist(server.port)
    person.wait_for(f"motiondeck: no deck is running on port {server.port}; start one with: motiondeck play")
    assert person.process.wait(30.0) == 1
    os.close(person.hand)


def test_listening_ends_when_the_deck_goes_away(capsys, monkeypatch):
    monkeypatch.setattr("motiondeck.run.terminal._HEARTBEAT", 0.01)
    deck = Answering(last=GetStatus)

    def never_enough():  # asked between replies: the deck answers in this thread, however soon questions are repeated
        if GetStatus not in deck.heard:
            deck.answer()
        return False

    with closing(CommandClient(deck.server.port)) as client:
        client.post(Pause())
        listen_to(client, never_enough)
    assert capsys.readouterr().out.splitlines() == ["accepted", "The deck has ended."]
    assert deck.heard == [Pause, Subscribe, GetStatus]
