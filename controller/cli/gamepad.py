"""`motiondeck gamepad`: a gamepad as one more client of the deck that is running.

It is read through the kernel's joystick interface, which every driver of a gamepad on Linux serves: events of eight
bytes from /dev/input/js0 (time in ms, value, kind, number; Linux, Documentation/input/joydev). No library is needed.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Annotated, BinaryIO, NamedTuple

import typer

from controller.wire.command_socket import (
    DEFAULT_PORT,
    CommandClient,
    EmergencyStop,
    GetStatus,
    Home,
    Message,
    Pause,
    Refused,
    Reset,
    Resume,
    SetSpeed,
    State,
    Stop,
    Switch,
)
from controller.wire.messages import FASTEST, SLOWEST
from motiondeck_base.errors import MotiondeckError

_EVENT = struct.Struct("<IhBB")
_BUTTON, _AXIS = 1, 2  # kinds of event; what the kernel says of itself when the device is opened has 0x80 added
_FULL = 32767.0

TEMPO_AXIS, MOTION_AXIS = 1, 6
DEAD = 0.15
"""The share of a stick's way in which it counts as let go."""
STEP = 0.1
"""Tempi are sent in such steps, so that a hand on the stick does not flood the deck."""


class Button(IntEnum):
    """The buttons that mean something, as the drivers of common gamepads number them."""

    A, B, X, Y, START = 0, 1, 2, 3, 7


class Event(NamedTuple):
    """A button or an axis that has changed: its number, and 0 or 1, or -1 to 1."""

    axis: bool
    number: int
    value: float


def events(device: BinaryIO) -> Iterator[Event]:
    """What happens on a gamepad until it is gone; the state it was opened in does not count."""
    while len(data := device.read(_EVENT.size)) == _EVENT.size:
        _, value, kind, number = _EVENT.unpack(data)
        if kind == _AXIS:
            yield Event(True, number, value / _FULL)
        elif kind == _BUTTON:
            yield Event(False, number, float(value))


class Pad:
    """Turns events into commands.

    Args:
        motions: all there are, in the order in which the cross of the gamepad goes through them.
        motion: the one that is played.
    """

    def __init__(self, motions: Sequence[str], motion: str) -> None:
        self._motions = list(motions)
        self._place = self._motions.index(motion)
        self._paused = False
        self._tempo = 1.0

    def command(self, event: Event) -> Message | None:
        """What an event says, or None where it says nothing."""
        if event.axis:
            return self._moved(event.number, event.value)
        if not event.value:
            return None
        match event.number:
            case Button.A:
                self._paused = not self._paused
                return Pause() if self._paused else Resume()
            case Button.B:
                self._paused = True
                return EmergencyStop()
            case Button.X:
                return Home()
            case Button.Y:
                return Reset()
            case Button.START:
                return Stop()
        return None

    def _moved(self, axis: int, value: float) -> Message | None:
        if axis == MOTION_AXIS and value:
            self._place = (self._place + (1 if value > 0.0 else -1)) % len(self._motions)
            self._paused = False
            return Switch(self._motions[self._place])
        if axis == TEMPO_AXIS:
            tempo = tempo_of(value)
            if abs(tempo - self._tempo) >= 0.5 * STEP:
                self._tempo = tempo
                return SetSpeed(tempo)
        return None


def tempo_of(value: float) -> float:
    """The tempo of a stick from -1 (pushed up, fastest) to 1 (pulled down, slowest), in steps; 1 where it is let go."""
    way = max(0.0, (abs(value) - DEAD) / (1.0 - DEAD))
    tempo = 1.0 + way * (FASTEST - 1.0) if value < 0.0 else 1.0 - way * (1.0 - SLOWEST)
    return min(max(round(tempo / STEP) * STEP, SLOWEST), FASTEST)


def drive(device: BinaryIO, client: CommandClient) -> None:
    """Commands the deck until the gamepad is gone, which pauses it.

    Raises:
        SocketError: if no deck is running.
    """
    from controller.cli.session.terminal import describe

    state = client.request(GetStatus())
    if not isinstance(state, State):
        raise MotiondeckError(f"the deck does not say what it plays: {describe(state)}")
    pad = Pad(state.motions, state.motion)
    try:
        for event in events(device):
            message = pad.command(event)
            if message is None:
                continue
            reply = client.request(message)
            if isinstance(reply, Refused) or not isinstance(message, SetSpeed):
                print(f"{' '.join(_words(message))}: {describe(reply)}", flush=True)
            if isinstance(message, Stop):
                return
    except OSError:
        pass  # it was pulled out
    client.request(Pause())
    raise MotiondeckError("the gamepad is gone, so the deck was paused")


def _words(message: Message) -> list[str]:
    """A command as it would be typed."""
    said = [str(message.__struct_config__.tag)]
    return [*said, message.to] if isinstance(message, Switch) else said


def gamepad(
    device: Annotated[
        Path, typer.Option("--device", metavar="FILE", help="Of the gamepad; the second one is /dev/input/js1.")
    ] = Path("/dev/input/js0"),
    command_port: Annotated[int, typer.Option("--command-port", help="The deck's command port.")] = DEFAULT_PORT,
) -> None:
    """Command the deck that is running with a gamepad.

    Cross left and right: the motion before or after. Left stick: tempo. A: pause and go on. B: emergency stop. Y: reset
    it. X: home. Start: stop. Pulled out, the deck is paused.

    Example:  motiondeck gamepad --device /dev/input/js1
    """
    try:
        stream = device.open("rb", buffering=0)
    except OSError as error:
        raise MotiondeckError(
            f"{device}: there is no gamepad to be read ({error.strerror or error}). Plug one in, or give its --device"
        ) from None
    client = CommandClient(command_port)
    try:
        with stream:
            print("cross: motion, left stick: tempo, A: pause, B: emergency stop, Y: reset, X: home, Start: stop")
            drive(stream, client)
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        client.close()
