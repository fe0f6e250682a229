"""A gamepad: what its buttons and sticks say, and a whole one played through a pipe."""

import io
import os
import struct
import threading
import time
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.cli.gamepad import Button, Event, Pad, drive, events, gamepad, tempo_of
from controller.wire.command_socket import (
    Accepted,
    CommandClient,
    CommandServer,
    EmergencyStop,
    GetStatus,
    Home,
    Pause,
    Reset,
    Resume,
    SetSpeed,
    State,
    Stop,
    Switch,
)
from motiondeck_base.errors import MotiondeckError

MOTIONS = ("walk", "jog", "waltz")


def packed(kind, number, value):
    return struct.pack("<IhBB", 12345, value, kind, number)


def press(button):
    return Event(False, button, 1.0)


def test_what_the_kernel_says_at_first_and_half_an_event_do_not_count():
    data = packed(0x81, 1, 1) + packed(0x82, 1, -32767) + packed(1, 1, 1) + packed(2, 6, 32767) + b"\x00\x01"
    assert list(events(io.BytesIO(data))) == [Event(False, 1, 1.0), Event(True, 6, 1.0)]


@pytest.mark.parametrize(
    ("button", "message"),
    [(Button.B, EmergencyStop()), (Button.X, Home()), (Button.Y, Reset()), (Button.START, Stop()), (5, None)],
)
def test_buttons_mean_commands_when_pressed_only(button, message):
    pad = Pad(MOTIONS, "walk")
    assert pad.command(press(button)) == message
    assert pad.command(Event(False, button, 0.0)) is None


def test_the_same_button_pauses_and_goes_on_also_after_an_emergency_stop():
    pad = Pad(MOTIONS, "walk")
    assert [pad.command(press(Button.A)) for _ in range(3)] == [Pause(), Resume(), Pause()]
    pad.command(press(Button.B))
    assert pad.command(press(Button.A)) == Resume()


def test_the_cross_goes_round_through_the_motions():
    pad = Pad(MOTIONS, "jog")
    right, left, released = (Event(True, 6, value) for value in (1.0, -1.0, 0.0))
    said = [pad.command(event) for event in (right, released, right, left)]
    assert said == [Switch("waltz"), None, Switch("walk"), Switch("waltz")]


@given(st.lists(st.floats(-1.0, 1.0), max_size=30))
def test_the_stick_sends_allowed_tempi_and_few_of_them(values):
    pad = Pad(MOTIONS, "walk")
    sent = [message for value in values if (message := pad.command(Event(True, 1, value)))]
    assert all(isinstance(message, SetSpeed) and 0.1 <= message.factor <= 3.0 for message in sent)
    assert all(a.factor != b.factor for a, b in pairwise(sent))


def test_let_go_the_stick_is_tempo_one_and_its_ends_are_the_fastest_and_slowest():
    assert [tempo_of(value) for value in (0.0, 0.1, -1.0, 1.0)] == [1.0, 1.0, 3.0, pytest.approx(0.1)]


def test_a_gamepad_that_is_pulled_out_pauses_the_deck():
    server, heard, ended = CommandServer(0), [], threading.Event()

    def deck():
        while not ended.is_set():
            for message, sender in server.poll():
                heard.append(type(message))
                state = State("walk", list(MOTIONS), 1.0, False, False, message.id)
                server.reply(sender, state if isinstance(message, GetStatus) else Accepted(message.id))
            time.sleep(0.001)

    thread = threading.Thread(target=deck)
    thread.start()
    reading, writing = os.pipe()
    os.write(writing, packed(2, 6, 32767) + packed(1, 1, 1))
    os.close(writing)
    client = CommandClient(server.port)
    try:
        with open(reading, "rb", buffering=0) as device, pytest.raises(MotiondeckError, match="unplugged"):  # noqa: PTH123
            drive(device, client)
    finally:
        ended.set()
        thread.join()
        client.close()
        server.close()
    assert heard == [GetStatus, Switch, EmergencyStop, Pause]


def test_no_gamepad_is_said_in_one_line(tmp_path):
    with pytest.raises(MotiondeckError, match="there is no gamepad"):
        gamepad(tmp_path / "js0", 1)
