"""`motiondeck gamepad`: commands a running deck with a gamepad.

It is read through the kernel's joystick interface, which every gamepad driver on Linux provides: events of eight bytes
from /dev/input/js0 (time in ms, value, kind, number; Linux, Documentation/input/joydev). No library is needed.
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
from controller.wire.command_table import TEMPO, command_of
from motiondeck_base.errors import MotiondeckError

_EVENT = struct.Struct("<IhBB")
_BUTTON, _AXIS = 1, 2  # kinds of event; the initial state that the kernel reports on opening has 0x80 added
_FULL = 32767.0

TEMPO_AXIS, MOTION_AXIS = 1, 6
DEAD = 0.15
"""Deflections of a stick up to this share of the full one count as released."""
STEP = 0.1
"""Tempos are sent in such steps, so that a hand on the stick does not flood the deck."""


class Button(IntEnum):
    """The buttons in use, as the drivers of common gamepads number them."""

    A, B, X, Y, START = 0, 1, 2, 3, 7


class Event(NamedTuple):
    """A change of a button (0 or 1) or an axis (-1 to 1)."""

    axis: bool
    number: int
    value: float


def events(device: BinaryIO) -> Iterator[Event]:
    """The events of a gamepad until it is unplugged; the state reported on opening is left out."""
    while len(data := device.read(_EVENT.size)) == _EVENT.size:
        _, value, kind, number = _EVENT.unpack(data)
        if kind == _AXIS:
            yield Event(True, number, value / _FULL)
        elif kind == _BUTTON:
            yield Event(False, number, float(value))


class Pad:
    """Turns events into commands.

    Args:
        motions: all motions, in the order in which the cross of the gamepad steps through them.
        motion: the one that is playing.
    """

    def __init__(self, motions: Sequence[str], motion: str) -> None:
        self._motions = list(motions)
        self._place = self._motions.index(motion)
        self._paused = False
        self._tempo = 1.0

    def command(self, event: Event) -> Message | None:
        """The command of an event, or None where it has none."""
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
    """The tempo of a stick from -1 (up, fastest) to 1 (down, slowest), in steps of STEP; 1 where it is released."""
    deflection = max(0.0, (abs(value) - DEAD) / (1.0 - DEAD))
    tempo = 1.0 + deflection * ((TEMPO.highest if value < 0.0 else TEMPO.lowest) - 1.0)
    return min(max(round(tempo / STEP) * STEP, TEMPO.lowest), TEMPO.highest)


def drive(device: BinaryIO, client: CommandClient) -> None:
    """Commands the deck until the gamepad is unplugged; then the deck is paused.

    Raises:
        SocketError: if no deck is running.
    """
    from controller.cli.session.terminal import describe

    state = client.request(GetStatus())
    if not isinstance(state, State):
        raise MotiondeckError(f"the deck did not report what it plays: {describe(state)}")
    pad = Pad(state.motions, state.motion)
    try:
        for event in events(device):
            message = pad.command(event)
            if message is None:
                continue
            reply = client.request(message)
            if isinstance(reply, Refused) or not isinstance(message, SetSpeed):
                print(f"{_typed(message)}: {describe(reply)}", flush=True)
            if isinstance(message, Stop):
                return
    except OSError:
        pass  # unplugged
    client.request(Pause())
    raise MotiondeckError("the gamepad was unplugged, so the deck was paused")


def _typed(message: Message) -> str:
    """A command as a person would type it."""
    word = command_of(message).word
    return f"{word} {message.to}" if isinstance(message, Switch) else word


def gamepad(
    device: Annotated[
        Path, typer.Option("--device", metavar="FILE", help="The gamepad; a second one is /dev/input/js1.")
    ] = Path("/dev/input/js0"),
    command_port: Annotated[int, typer.Option("--command-port", help="The deck's command port.")] = DEFAULT_PORT,
) -> None:
    """Command the running deck with a gamepad.

    Cross left and right: previous and next motion. Left stick: tempo. A: pause and resume. B: emergency stop. Y: reset.
    X: home. Start: stop. Unplugging the gamepad pauses the deck.

    Example:  motiondeck gamepad --device /dev/input/js1
    """
    try:
        stream = device.open("rb", buffering=0)
    except OSError as error:
        raise MotiondeckError(
            f"{device}: there is no gamepad here ({error.strerror or error}). Plug one in, or give another --device"
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
