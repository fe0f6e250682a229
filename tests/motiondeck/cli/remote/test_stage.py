"""`motiondeck stage`: what it says at the start, what it prints, and every way in which it cannot go on."""

import os
import socket
import sys
import threading
import time

import pytest

from command_line import motiondeck
from controller.wire.command_socket import CommandServer
from controller.wire.messages.commands import FollowPerson, GetStatus, Pause, Subscribe, Switch
from controller.wire.messages.replies import Accepted, Event, Refused, State
from motiondeck.cli.remote.stage import Sparing, _print_reply
from waiting import free_port

mido = pytest.importorskip("mido")
udp_client = pytest.importorskip("pythonosc.udp_client")


class StandIn:
    """A deck that plays walk or jog, refuses jog, and ends when it has had `last`."""

    def __init__(self, last=()):
        self.server, self.heard, self.last, self.left = CommandServer(0), [], last, threading.Event()
        self.thread = threading.Thread(target=self._run)

    def _run(self):
        while not self.left.is_set():
            for message, sender in self.server.poll():
                if isinstance(message, GetStatus):
                    self.server.reply(sender, State(motion="walk", motions=["walk", "jog"], id=message.id))
                    continue
                self.heard.append(message)
                refused = isinstance(message, Switch) and message.to == "jog"
                self.server.reply(sender, Refused("not now", message.id) if refused else Accepted(message.id))
                if type(message) in self.last:
                    self.server.reply(sender, Event("ended", "the run is over", number=1))
            time.sleep(0.001)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.left.set()
        self.thread.join()
        self.server.close()


def stage(deck, file):
    return motiondeck("stage", file, "--command-port", deck.server.port)


def written(folder, text):
    file = folder / "show.toml"
    file.write_text(text)
    return file


def test_it_prints_commands_and_replies_until_the_deck_has_ended(tmp_path):
    port = free_port()
    file = written(tmp_path, f'[osc]\nlisten = {port}\n[osc.commands]\n"/to" = "switch $1"\n"/pause" = "pause"\n')
    with StandIn(last=(Pause,)) as deck, udp_client.SimpleUDPClient("127.0.0.1", port) as desk:

        def press():
            while not any(isinstance(message, Subscribe) for message in deck.heard):
                time.sleep(0.001)
            desk.send_message("/to", "jog")
            desk.send_message("/to", [])
            desk.send_message("/pause", 1)

        pressing = threading.Thread(target=press)
        pressing.start()
        result = stage(deck, file)
        pressing.join()
    assert (result.returncode, result.stderr) == (0, "/to: argument 1 is missing; it is mapped to: switch $1\n")
    lines = result.stdout.splitlines()
    assert lines == [
        f"show.toml: OSC on port {port} of loopback (2 addresses)",
        "/to: switch: refused: not now",
        "/pause: pause: accepted",
    ]


def test_a_midi_device_that_goes_pauses_the_deck(tmp_path):
    device = tmp_path / "midi"
    os.mkfifo(device)
    with StandIn() as deck:

        def unplug():
            os.close(os.open(device, os.O_WRONLY))

        unplugging = threading.Thread(target=unplug)
        unplugging.start()
        result = stage(deck, written(tmp_path, f'[midi]\ninput = "{device}"\nclock = true\n'))
        unplugging.join()
    assert result.returncode == 1
    assert result.stderr == f"motiondeck: the MIDI device {device} is gone, so the deck was paused\n"
    assert type(deck.heard[-1]) is Pause


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('[osc]\nlisten = 9\n[osc.commands]\n"/a" = "wolk"', "'wolk': unknown motion 'wolk'. Did you mean walk?"),
        ("[osc]\nlisten = PORT\n", "OSC cannot listen on port PORT (Address already in use). Choose another"),
        ('[midi]\ninput = "/dev/no/midi"', "MIDI input '/dev/no/midi' cannot be opened (No such file or directory)"),
        ('[osc]\nsend_to = "no.such.host.invalid:9"', "OSC cannot be sent to no.such.host.invalid"),
    ],
)
def test_what_cannot_be_opened_is_one_line(tmp_path, text, problem):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken, StandIn() as deck:
        taken.bind(("127.0.0.1", 0))
        port = str(taken.getsockname()[1])
        result = stage(deck, written(tmp_path, text.replace("PORT", port)))
    assert result.returncode == 1
    assert result.stderr.count("\n") == 1
    assert problem.replace("PORT", port) in result.stderr


@pytest.mark.parametrize(
    ("module", "text", "problem"),
    [
        ("pythonosc", "[osc]\nlisten = 9\n", "OSC needs python-osc"),
        ("mido", '[midi]\ninput = "/dev/midi"', "MIDI needs mido"),
        ("mido.backends.rtmidi", '[midi]\ninput = "Desk"', "MIDI port 'Desk' cannot be opened"),
    ],
)
def test_without_the_extra_the_error_names_it(monkeypatch, tmp_path, module, text, problem):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setattr(mido.backend, "_module", None)  # another test may have loaded it
    with StandIn() as deck:
        result = stage(deck, written(tmp_path, text))
    assert result.returncode == 1
    assert problem in result.stderr
    assert 'pip install "motiondeck[stage]"' in result.stderr


@pytest.mark.parametrize(("devices", "says"), [((), "There are none"), (("midiC1D0", "midiC2D0"), "midiC2D0")])
def test_a_raw_device_that_is_not_there_is_one_line_with_those_that_are(monkeypatch, tmp_path, devices, says):
    monkeypatch.setattr("motiondeck.stage.midi.RAW_DEVICES", tmp_path)
    for device in devices:
        (tmp_path / device).touch()
    with StandIn() as deck:
        result = stage(deck, written(tmp_path, '[midi]\ninput = "/dev/no/midi"'))
    assert result.returncode == 1
    assert result.stderr.count("\n") == 1
    assert says in result.stderr


def test_without_a_deck_it_says_how_to_start_one(tmp_path):
    result = motiondeck("stage", written(tmp_path, "[osc]\nlisten = 9\n"), "--command-port", 1)
    assert (result.returncode, result.stderr) == (
        1,
        "motiondeck: no deck is running on port 1; start one with: motiondeck play\n",
    )


def test_what_a_message_carries_is_printed_on_one_line_without_control_characters(capsys):
    _print_reply(Sparing(), "/motion", Switch(to="wave"), Refused(reason="unknown motion 'wa\nve\x1b[31m\x07'"))
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    assert out.strip().isprintable()


def test_a_place_that_is_refused_again_and_again_is_told_once_a_second(capsys):
    tell = Sparing()
    for _ in range(30):
        _print_reply(tell, "tracker", FollowPerson("walk", 0.3), Refused(reason="the emergency stop is on"))
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("the emergency stop is on") == 1
