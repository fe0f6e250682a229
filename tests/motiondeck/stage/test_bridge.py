"""A deck commanded by real OSC and MIDI messages, in virtual time; what it does is judged by its own phase."""

import os
import socket
import struct
import threading
import time
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest

import synthetic
from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits
from controller.deck.layers import Layers
from controller.deck.locks.phase_lock import wrapped
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.stop_requests import StopRequest
from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.local_transport import PeerGoneError, SocketError
from controller.wire.messages.commands import GiveBeat
from controller.wire.messages.replies import Accepted, Refused
from motiondeck.stage.bridge import Bridge
from motiondeck.stage.command_pattern import CommandPattern
from motiondeck.stage.midi import MidiGoneError, MidiInput, open_midi_port
from motiondeck.stage.osc import OscInput, OscOutput
from motiondeck.stage.stage_file import MidiMap
from motiondeck.stage.timecode import Timecode
from waiting import free_port, until

mido = pytest.importorskip("mido")
udp_client = pytest.importorskip("pythonosc.udp_client")
osc_bundle_builder = pytest.importorskip("pythonosc.osc_bundle_builder")
osc_message_builder = pytest.importorskip("pythonosc.osc_message_builder")

DT = 0.01
COMMANDS = {"/motion": "switch $1", "/march": "switch march", "/tempo": "tempo $1", "/beat": "beat", "/estop": "estop"}
COMMANDS |= {"/input/jaw": "input jaw $1", "/gaze": "gaze $1 $2"}
JOINTS = ("pan", "jaw")
CONTROLS = {1: "input jaw $1 60", 2: "input pan $2", 64: "switch wave"}


def patterns(table):
    return {key: CommandPattern(text) for key, text in table.items()}


def twin():
    """Stands in for the retargeter of a robot with two joints, which rest."""
    return lambda pose: np.zeros(len(JOINTS))


def unread(port):
    """How much has come to a port and was not read, bytes."""
    rows = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return sum(int(row[4].split(":")[1], 16) for row in rows if int(row[1].split(":")[1], 16) == port)


class Desk(udp_client.SimpleUDPClient):
    """A client whose messages have come when they are sent."""

    def send(self, content):
        before = unread(self._port)
        super().send(content)
        until(lambda: unread(self._port) > before, "the message")


class Stage:
    """A deck in virtual time, a bridge to it, and real clients of that bridge."""

    def __init__(self, cleanup, folder, clock=True, notes=(), cues=(), send_to=None):
        library = synthetic.small_phase_library()
        self.deck = Deck(library, twin(), "march", phase=0.3)
        limits = JointLimits(*np.array([[-1.0, 0.5, 10.0, 400.0, 2e4]] * len(JOINTS)).T)
        self.deck.layers = Layers(library, JOINTS, limits, {}, twin, gaze={"pan": (0.5, 0.0)})
        self.stop, self.told, self.replies = StopRequest(), [], []
        server = cleanup.enter_context(closing(CommandServer(0)))
        self.desk = CommandHandler(CommandedRun(self.deck), [server])
        port = free_port()
        self.osc_input = cleanup.enter_context(closing(OscInput(port, patterns(COMMANDS), self.told.append)))
        self.osc = cleanup.enter_context(Desk("127.0.0.1", port))
        device = folder / "midi"
        os.mkfifo(device)
        mapped = MidiMap(str(device), 9, clock, patterns(dict(notes)), patterns(CONTROLS), patterns(dict(cues)))
        midi_input = cleanup.enter_context(closing(MidiInput(open_midi_port(mapped.input), mapped)))
        self.midi = os.open(device, os.O_WRONLY)
        output = cleanup.enter_context(closing(OscOutput(*send_to))) if send_to else None
        client = cleanup.enter_context(closing(CommandClient(server.port)))
        self.bridge = Bridge(
            client, [self.osc_input, midi_input], output, self.answered, self.told.append, lambda: self.deck.time
        )
        self.phases, self.targets = [], []

    def answered(self, source, command, reply):
        self.replies.append((source, command, reply))

    def play(self, kind, **fields):
        """Sends a MIDI message as mido writes it."""
        os.write(self.midi, bytes(mido.Message(kind, **fields).bytes()))

    def tick(self):
        running = self.bridge.step(0.0)
        self.desk(self.stop)
        self.targets.append(self.deck.update(DT)[0].copy())
        self.phases.append((self.deck.time, self.deck.phase))
        return running

    def run(self, seconds, happening=()):
        """Plays on for some seconds; `happening` is pairs of a time and what to call then."""
        waiting = sorted(happening, key=lambda pair: pair[0])
        end = self.deck.time + seconds
        while self.deck.time < end - 0.5 * DT:
            while waiting and waiting[0][0] <= self.deck.time:
                waiting.pop(0)[1]()
            self.tick()

    def misses(self, beats, phase, steps):
        """By how much steps of the motion miss beats, s."""
        times, phases = np.array(self.phases).T
        at = np.interp(beats, times, np.unwrap(phases, period=1.0))
        return np.array([wrapped(place - phase, 1.0 / steps) for place in at]) / self.deck.phase_rate


@pytest.fixture
def stage(tmp_path):
    with ExitStack() as cleanup:
        made = []

        def make(**more):
            made.append(Stage(cleanup, tmp_path, **more))
            return made[-1]

        yield make
        for each in made:
            os.close(each.midi)


def test_an_osc_client_switches_the_motion_and_its_beats_lock_the_phase(stage):
    show = stage()
    beats = 0.5 + 0.45 * np.arange(13)
    show.osc.send_message("/motion", "wave")
    show.run(6.5, [(beat, lambda: show.osc.send_message("/beat", [])) for beat in beats])
    assert show.deck.motion == "wave"
    assert [type(reply) for _, command, reply in show.replies if not isinstance(command, GiveBeat)] == [Accepted]
    assert sum(isinstance(command, GiveBeat) for _, command, _ in show.replies) == len(beats)
    assert np.abs(show.misses(beats[9:], 0.0, round(1.0 / show.deck.phase_rate / 0.45))).max() < 0.02
    assert [text.split(" of ")[0] for text in show.told] == ["searching for the beat", "locked to the beat"]
    assert show.deck.lock_state.per_minute == pytest.approx(60.0 / 0.45, rel=0.01)


def test_a_note_switches_and_the_clock_of_midi_locks_the_phase(stage):
    show = stage(notes=[(36, "switch wave")])
    pulses = 0.4 + 0.5 / 24.0 * np.arange(24 * 11)
    happening = [(pulse, lambda: show.play("clock")) for pulse in pulses]
    happening += [
        (0.1, lambda: show.play("note_on", note=36, velocity=90, channel=3)),
        (0.2, lambda: show.play("note_on", note=37, velocity=90, channel=9)),
        (0.3, lambda: show.play("start")),
    ]
    show.run(0.35, happening[-3:])
    assert show.deck.motion == "march"  # another channel, a note of no command
    show.play("note_on", note=36, velocity=90, channel=9)
    show.play("note_on", note=36, velocity=0, channel=9)  # released
    show.run(5.6, happening[:-3])
    beats = pulses[::24]
    assert show.deck.motion == "wave"
    assert sum(isinstance(command, GiveBeat) for _, command, _ in show.replies) == len(beats)
    assert np.abs(show.misses(beats[8:], 0.0, round(1.0 / show.deck.phase_rate / 0.5))).max() < 0.02
    assert show.deck.lock_state.state == "locked"


def test_a_jaw_follows_messages_and_falls_back_when_their_sender_is_silent(stage):
    show = stage()
    generator = np.random.default_rng(2)
    sent = [0.1 + 0.02 * n for n in range(50) if generator.random() > 0.2]  # 50 a second, a fifth of them lost
    wide = [0.5 + 0.4 * np.sin(6.0 * at) for at in sent]
    # As OSC 1.0 writes one float, by hand: texts and zeros to a multiple of four bytes.
    data = [b"/input/jaw\0\0,f\0\0" + struct.pack(">f", value) for value in wide]
    send = show.osc._sock.sendto
    to = "127.0.0.1", show.osc._port
    show.run(4.0, [(at, lambda one=one: send(one, to)) for at, one in zip(sent, data, strict=True)])
    jaw, pan = np.array(show.targets)[:, 1], np.array(show.targets)[:, 0]
    times = DT * (1.0 + np.arange(len(jaw)))
    judged = (times > 0.4) & (times < 1.1)
    late = 0.5 * (0.5 + 0.4 * np.sin(6.0 * (times - 0.04)))  # half a rad is all that it opens
    assert jaw[judged] == pytest.approx(late[judged], abs=0.04)
    assert jaw[times > 3.0] == pytest.approx(0.0, abs=0.0)
    assert not pan.any()
    assert show.deck.layered == {}
    assert {type(reply) for _, _, reply in show.replies} == {Accepted}
    show.osc.send_message("/gaze", [1.0, 0.0])
    show.run(0.4)
    assert show.targets[-1] == pytest.approx([np.pi / 8, 0.0], abs=1e-4)
    show.osc.send_message("/input/jaw", 1.5)
    show.run(0.05)
    assert "jaw goes from -1" in show.replies[-1][2].reason


def test_a_controller_moves_a_joint_and_a_pedal_is_a_button(stage):
    show = stage()
    show.play("control_change", control=1, value=127, channel=9)
    show.play("control_change", control=2, value=0, channel=9)
    show.play("control_change", control=64, value=0, channel=9)  # released
    show.play("control_change", control=1, value=0, channel=3)  # another channel
    show.play("control_change", control=3, value=0, channel=9)
    show.run(0.4)
    assert show.targets[-1] == pytest.approx([-1.0, 0.5], abs=1e-3)
    assert show.deck.motion == "march"
    show.run(3.0)
    assert show.targets[-1] == pytest.approx([0.0, 0.5], abs=1e-3)  # one falls back, the other holds for a minute
    show.play("control_change", control=64, value=127, channel=9)
    show.run(0.1)
    assert show.deck.motion == "wave"


def quarter_frames(frame, rate=25, kind=1):
    """The eight messages that say the time of a frame."""
    seconds, frames = divmod(frame, rate)
    minutes, seconds = divmod(seconds, 60)
    values = [frames, seconds, minutes, 0]
    nibbles = [nibble for value in values for nibble in (value & 15, value >> 4)]
    nibbles[7] |= kind << 1
    return [{"frame_type": piece, "frame_value": nibble} for piece, nibble in enumerate(nibbles)]


def test_a_cue_comes_at_its_time_of_the_timecode(stage):
    cue = 30  # frames of 25 a second: 1.2 s
    show = stage(cues=[(Timecode(0, 0, 1, 5), "switch wave")])
    happening = []
    for frame in range(0, 40, 2):
        for piece, fields in enumerate(quarter_frames(frame)):
            at = (frame + 0.25 * piece) / 25.0
            happening.append((at, lambda fields=fields: show.play("quarter_frame", **fields)))
    switched = []
    show.bridge._answered = lambda source, command, reply: switched.append((source, show.deck.time))
    show.run(1.5, happening)
    assert [source for source, _ in switched] == ["00:00:01:05"]
    assert switched[0][1] == pytest.approx(cue / 25.0, abs=1.5 * DT)  # a tick to hear it
    assert show.deck.motion == "wave"


def test_a_bundle_counts_at_its_time_and_an_emergency_stop_at_once(stage):
    show = stage()
    builder = osc_bundle_builder.OscBundleBuilder(time.time() + 0.5)
    builder.add_content(osc_message_builder.OscMessageBuilder("/motion").build())
    for address, value in (("/motion", "wave"), ("/estop", 1.0)):
        message = osc_message_builder.OscMessageBuilder(address)
        message.add_arg(value)
        builder.add_content(message.build())
    show.osc.send(builder.build())
    show.run(0.1)
    assert show.stop.emergency
    assert show.told == ["/motion: argument 1 is missing; it is mapped to: switch $1"]
    assert [source for source, _, _ in show.replies] == ["/estop"]
    show.run(0.6)
    sources = [(source, type(reply)) for source, _, reply in show.replies]
    assert sources == [("/estop", Accepted), ("/motion", Refused)]  # as any command during an emergency stop


def test_a_button_counts_when_it_is_pressed_and_mistakes_are_told(stage):
    show = stage()
    show.osc.send_message("/motion", "wave")
    show.osc.send_message("/march", 0.0)
    show.osc.send_message("/nothing", 1)
    show.osc.send_message("/tempo", 9.0)
    show.run(0.05)
    assert show.deck.motion == "wave"
    show.osc.send_message("/march", 1.0)
    show.osc.send_message("/tempo", 1.0)
    show.run(0.05)
    assert show.deck.motion == "march"
    assert show.told == ["/tempo: tempo: TEMPO must be a number from -3 to 3, not 9"]


def test_events_and_states_reach_an_osc_server(stage):
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as desk:
        desk.bind(("127.0.0.1", 0))
        desk.setblocking(False)
        show = stage(send_to=desk.getsockname())
        show.osc.send_message("/motion", "wave")
        show.run(1.0)
        from pythonosc.osc_message import OscMessage

        heard = []
        try:
            while True:
                heard.append(OscMessage(desk.recv(2048)))
        except BlockingIOError:
            pass
    by_address = {message.address: message.params for message in heard}
    assert by_address["/motiondeck/motion"] == ["wave"]
    assert by_address["/motiondeck/tempo"] == [1.0]
    assert by_address["/motiondeck/phase"][0] == pytest.approx(show.deck.phase, abs=0.2)
    assert by_address["/motiondeck/mode"] == ["playing"]
    assert by_address["/motiondeck/lock"] == ["none"]
    kinds = [message.params[0] for message in heard if message.address == "/motiondeck/event"]
    assert kinds[0] == "motion"
    assert [message.address for message in heard].count("/motiondeck/tempo") == pytest.approx(10, abs=1)


def test_random_datagrams_are_left_out_in_one_line(stage):
    show = stage()
    generator = np.random.default_rng(3)
    whole = osc_message_builder.OscMessageBuilder("/tempo")
    whole.add_arg(2.0)
    datagrams = [generator.bytes(int(size)) for size in generator.integers(1, 200, 150)]
    datagrams += [whole.build().dgram[:size] for size in range(1, 12)]
    datagrams += [b"#bundle\0" + struct.pack(">Q", 1) + bytes(generator.bytes(40)) for _ in range(30)]
    datagrams += [(b"#bundle\0" + struct.pack(">Q", 1)) * 200, b"/a\0\0,[[[[[\0\0"]
    for datagram in datagrams:
        show.osc._sock.sendto(datagram, ("127.0.0.1", show.osc._port))
        show.tick()
    assert show.deck.tempo == 1.0
    assert show.replies == []
    assert all("\n" not in text for text in show.told)


def bundle(contents, seconds=0.0):
    """A bundle of messages, each an address and its argument, for a time from now."""
    builder = osc_bundle_builder.OscBundleBuilder(time.time() + seconds)
    for address, value in contents:
        message = osc_message_builder.OscMessageBuilder(address)
        message.add_arg(value)
        builder.add_content(message.build())
    return builder.build()


NUMBERS = [float("nan"), float("inf"), 1e30, "nan", "", "1;2", b"\0\xff\n", [1.0, 2.0], True, 2**31 - 1]


def test_values_that_are_no_number_are_told_in_one_line_each(stage):
    show = stage()
    for value in NUMBERS:
        show.osc.send(bundle([("/tempo", value)]))
        show.run(0.03)
    show.osc.send_message("/motion", "wa\nve\x1b[31m")
    show.run(0.1)
    assert len(show.told) == len(NUMBERS)
    assert all(text.startswith("/tempo: tempo: TEMPO must be a number") and "\n" not in text for text in show.told)
    assert [type(reply) for _, _, reply in show.replies] == [Refused]
    assert (show.deck.motion, show.deck.tempo) == ("march", 1.0)


def test_a_flood_is_left_out_but_for_its_emergency_stop(stage):
    show = stage()
    show.osc.send(bundle([("/tempo", 1.0)] * 1500))
    before = show.deck.phase
    show.run(0.5)
    assert show.deck.phase != before
    assert len(show.told) == 1500 - 256  # what does not wait
    assert set(show.told) == {"/tempo: too many commands at once, so it was left out"}
    show.osc.send_message("/motion", "wave")
    show.run(0.1)
    assert show.deck.motion == "wave"
    show.osc.send(bundle([("/tempo", 1.0)] * 1000 + [("/estop", 1.0)]))
    show.tick()
    assert show.stop.emergency


def test_a_deck_that_is_held_up_is_told_and_commanded_again_later(stage, monkeypatch):
    show = stage()

    def fails(error):
        def post(message):
            raise error

        return post

    with monkeypatch.context() as held:
        held.setattr(show.bridge._client, "post", fails(SocketError("it is held up")))
        show.osc.send(bundle([("/motion", "wave")] * 9))
        show.tick()
    assert set(show.told) == {"it is held up, so what came meanwhile was left out"}
    show.osc.send_message("/motion", "wave")
    show.run(0.1)
    assert show.deck.motion == "wave"
    monkeypatch.setattr(show.bridge._client, "post", fails(PeerGoneError("it is gone")))
    show.osc.send_message("/motion", "wave")
    with pytest.raises(PeerGoneError):
        show.run(0.1)


def test_midi_that_means_nothing_is_passed_over(stage):
    show = stage(notes=[(36, "switch wave")])
    generator = np.random.default_rng(5)
    for size in generator.integers(1, 200, 100):  # any data bytes and controllers, never a note on
        os.write(show.midi, bytes([0xB0, *generator.integers(0, 128, size).tolist()]))
        show.tick()
    os.write(show.midi, b"\xf0" + bytes(4000))  # a message of a maker that never ends
    show.tick()
    assert (show.deck.motion, show.replies) == ("march", [])
    show.play("note_on", note=36, velocity=90, channel=9)
    show.run(0.1)
    assert show.deck.motion == "wave"


def test_a_program_of_another_user_is_not_heard(stage, monkeypatch):
    show = stage()
    monkeypatch.setattr("motiondeck.stage.osc.owners_of_datagrams", lambda sender: {os.geteuid() + 1})
    show.osc.send_message("/estop", 1)
    show.run(0.02)
    assert not show.stop.emergency
    assert show.told == ["OSC from another user's program was left out"]


def test_it_listens_on_loopback_only(stage):
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as other:
        show = stage()
        # Another address of this machine; had the input taken them all, this one would be in use.
        other.bind(("127.0.0.2", show.osc._port))
        assert show.osc_input._socket.getsockname()[0] == "127.0.0.1"


def test_a_device_that_goes_ends_the_bridge(stage):
    show = stage()
    show.run(0.02)
    os.close(show.midi)
    show.midi = os.open(os.devnull, os.O_WRONLY)
    with pytest.raises(MidiGoneError, match="midi is gone"):
        show.run(0.02)


def test_a_port_of_a_midi_system_rings_from_its_thread(monkeypatch):
    """mido's own port class, with a backend that stands in for a MIDI system: messages come in a thread."""
    opened = {}

    def open_input(name, callback):
        opened[name] = callback
        return mido.ports.BaseInput(name)

    monkeypatch.setattr(mido, "open_input", open_input)
    with closing(MidiInput(open_midi_port("Desk"), MidiMap("Desk", None, True, {}, {}, {}))) as midi:
        thread = threading.Thread(target=opened["Desk"], args=(mido.Message("clock"),))
        before = time.monotonic()
        thread.start()
        thread.join()
        (signal,) = midi.read(before + 9.0)
        assert before <= signal.due <= time.monotonic()  # when it came, not when it was read
        assert list(midi.read(0.0)) == []
