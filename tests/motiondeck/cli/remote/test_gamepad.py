"""A gamepad: its events, the commands they give, and a whole session with a fake device."""

import sys
import threading
import time
from errno import ENODEV
from itertools import pairwise
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.messages.commands import (
    EmergencyStop,
    GetStatus,
    Home,
    Pause,
    Reset,
    Resume,
    SetTempo,
    Stop,
    Switch,
)
from controller.wire.messages.replies import Accepted, State
from motiondeck.cli.remote.gamepad import Button, Pad, Stick, deflection, drive, events, gamepad, open_gamepad, tempo_of
from motiondeck_base.errors import MotiondeckError

pytestmark = pytest.mark.smoke

MOTIONS = ("walk", "jog", "waltz")
SYN, KEY, ABS = 0, 1, 3
SOUTH, EAST, NORTH, WEST, START, LEFT, RIGHT, SHOULDER = 0x130, 0x131, 0x133, 0x134, 0x13B, 0x222, 0x223, 0x137
STICK, CROSS = 1, 16


class FakePad:
    """The part of evdev.InputDevice that is read; unplugged after its last event."""

    def __init__(self, *happening, held=(), span=(-32768, 32767)):
        self.happening, self.held, self.span = happening, list(held), span

    def read_loop(self):
        for kind, code, value in self.happening:
            yield SimpleNamespace(type=kind, code=code, value=value)
        raise OSError(ENODEV, "No such device")

    def absinfo(self, axis):
        assert axis == STICK
        return SimpleNamespace(min=self.span[0], max=self.span[1])

    def active_keys(self):
        return self.held


def seen(device):
    found = []
    with pytest.raises(OSError, match="No such device"):
        found.extend(events(device))
    return found


def test_buttons_count_when_pressed_and_other_codes_not_at_all():
    keys = [
        (KEY, code, value)
        for code in (SOUTH, EAST, NORTH, WEST, START, LEFT, RIGHT, SHOULDER, 0x136)
        for value in (1, 2, 0)
    ]
    assert seen(FakePad(*keys, (SYN, 0, 0), (ABS, 3, 99))) == [
        Button.A, Button.B, Button.X, Button.Y, Button.START, Button.LEFT, Button.RIGHT, Button.SHOULDER,
    ]  # fmt: skip


def test_the_cross_may_also_be_an_axis():
    assert seen(FakePad((ABS, CROSS, -1), (ABS, CROSS, 0), (ABS, CROSS, 1))) == [Button.LEFT, Button.RIGHT]


def test_an_emergency_stop_is_not_lost_with_the_events_that_the_kernel_drops():
    assert seen(FakePad((SYN, 3, 0), held=[EAST, SOUTH])) == [Button.B]
    assert seen(FakePad((SYN, 3, 0), held=[SOUTH])) == []


@given(st.integers(-(2**31), 2**31 - 1), st.integers(-40_000, 40_000), st.integers(1, 80_000))
def test_a_stick_is_scaled_by_the_range_of_its_axis(value, lowest, width):
    highest = lowest + width
    share = deflection(value, lowest, highest)
    assert -1.0 <= share <= 1.0
    assert share == -deflection(lowest + highest - value, lowest, highest)
    if lowest <= value <= highest:
        assert lowest + (share + 1.0) / 2.0 * width == pytest.approx(value, abs=1e-6 * width)
    assert seen(FakePad((ABS, STICK, value), span=(lowest, highest))) == [Stick(share)]


def test_the_ends_and_the_middle_of_common_sticks():
    assert [deflection(value, 0, 255) for value in (0, 255)] == [-1.0, 1.0]
    assert [tempo_of(deflection(value, 0, 255)) for value in (127, 128)] == [1.0, 1.0]
    assert deflection(5, 0, 0) == 0.0  # a driver that states no range


def test_our_codes_are_those_of_evdev():
    codes = pytest.importorskip("evdev").ecodes
    module = vars(sys.modules[Pad.__module__])
    ours = {name: code for name, code in module.items() if name.split("_")[0] in {"EV", "SYN", "ABS"}}
    assert len(ours) == 6
    assert ours == {name: getattr(codes, name) for name in ours}
    names = {"A": "SOUTH", "B": "EAST", "X": "NORTH", "Y": "WEST", "SHOULDER": "TR"}
    names |= {"START": "START", "LEFT": "DPAD_LEFT", "RIGHT": "DPAD_RIGHT"}
    assert {button.name: button.value for button in Button} == {
        button: getattr(codes, f"BTN_{name}") for button, name in names.items()
    }


@pytest.mark.parametrize(
    ("button", "message"),
    [(Button.B, EmergencyStop()), (Button.X, Home()), (Button.Y, Reset()), (Button.START, Stop())],
)
def test_buttons_mean_commands(button, message):
    assert Pad(MOTIONS, "walk").command(button) == message


def test_the_same_button_pauses_and_resumes_also_after_an_emergency_stop():
    pad = Pad(MOTIONS, "walk")
    assert [pad.command(Button.A) for _ in range(3)] == [Pause(), Resume(), Pause()]
    pad.command(Button.B)
    assert pad.command(Button.A) == Resume()


def test_the_cross_goes_round_through_the_motions():
    pad = Pad(MOTIONS, "jog")
    assert [pad.command(button) for button in (Button.RIGHT, Button.RIGHT, Button.LEFT)] == [
        Switch("waltz"),
        Switch("walk"),
        Switch("waltz"),
    ]


@given(st.lists(st.floats(-1.0, 1.0), max_size=30))
def test_the_stick_sends_allowed_tempos_and_few_of_them(values):
    pad = Pad(MOTIONS, "walk")
    sent = [message for value in values if (message := pad.command(Stick(value)))]
    assert all(isinstance(message, SetTempo) and 0.1 <= message.factor <= 3.0 for message in sent)
    assert all(a.factor != b.factor for a, b in pairwise(sent))


def test_a_released_stick_is_tempo_one_and_its_ends_are_the_fastest_and_slowest():
    assert [tempo_of(value) for value in (0.0, 0.1, -1.0, 1.0)] == [1.0, 1.0, 3.0, pytest.approx(0.1)]


def test_a_gamepad_that_is_unplugged_pauses_the_deck():
    server, heard, ended = CommandServer(0), [], threading.Event()

    def deck():
        while not ended.is_set():
            for message, sender in server.poll():
                heard.append(type(message))
                state = State(motion="walk", motions=list(MOTIONS), id=message.id)
                server.reply(sender, state if isinstance(message, GetStatus) else Accepted(message.id))
            time.sleep(0.001)

    thread = threading.Thread(target=deck)
    thread.start()
    client = CommandClient(server.port)
    try:
        with pytest.raises(MotiondeckError, match="unplugged"):
            drive(FakePad((ABS, CROSS, 1), (SYN, 0, 0), (KEY, EAST, 1)), client)
    finally:
        ended.set()
        thread.join()
        client.close()
        server.close()
    assert heard == [GetStatus, Switch, EmergencyStop, Pause]


def test_without_evdev_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "evdev", None)
    with pytest.raises(MotiondeckError, match=r'pip install "motiondeck\[gamepad\]"'):
        gamepad(None, 1)


class FakeEvdev:
    """evdev with devices of given capabilities."""

    def __init__(self, **capabilities):
        self.capabilities = capabilities

    def list_devices(self):
        return list(self.capabilities)

    def InputDevice(self, path):
        if path not in self.capabilities:
            raise FileNotFoundError(2, "No such file or directory")
        return SimpleNamespace(path=path, name=f"the {path}", capabilities=lambda absinfo: self.capabilities[path])


MOUSE, KEYBOARD, XBOX = {KEY: [0x110], 2: [0, 1]}, {KEY: [30, 48]}, {KEY: [SOUTH, EAST], ABS: [0, STICK]}


def test_the_first_gamepad_is_found_among_other_devices(monkeypatch):
    monkeypatch.setitem(sys.modules, "evdev", FakeEvdev(mouse=MOUSE, keyboard=KEYBOARD, xbox=XBOX, other=XBOX))
    assert open_gamepad(None).path == "xbox"
    assert open_gamepad("other").path == "other"


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (None, "there is no gamepad that you may read"),
        ("mouse", "mouse: 'the mouse' is not a gamepad"),
        ("none", r"none: no gamepad can be read here \(No such file"),
    ],
)
def test_no_gamepad_is_one_clear_line(monkeypatch, path, message):
    monkeypatch.setitem(sys.modules, "evdev", FakeEvdev(mouse=MOUSE))
    with pytest.raises(MotiondeckError, match=message):
        open_gamepad(path)


def test_evdev_itself_refuses_what_is_no_input_device(tmp_path):
    pytest.importorskip("evdev")
    (tmp_path / "event0").touch()
    with pytest.raises(MotiondeckError, match="no gamepad can be read here"):
        gamepad(tmp_path / "event0", 1)
