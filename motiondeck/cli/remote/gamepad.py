"""`motiondeck gamepad`: commands a running deck with a gamepad, read through the kernel's event interface (evdev).

Codes and directions follow the kernel's gamepad specification (Linux, Documentation/input/gamepad.rst), so one table
serves every gamepad whose driver follows it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from typer import Option

from controller.wire.command_socket import DEFAULT_PORT, CommandClient
from controller.wire.messages import commands
from controller.wire.messages.arguments import TEMPO
from controller.wire.messages.commands import DeckCommand
from controller.wire.messages.replies import Refused, State
from motiondeck.cli.remote.send import CommandPort, state_of
from motiondeck.run.terminal import describe
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from evdev import InputDevice

SLOWEST = 0.1  # the tempo of the stick when it is pulled all the way down
DEAD = 0.15  # deflections of the stick up to this share of the full one count as released
STEP = 0.1  # tempos are sent in such steps, so that a hand on the stick does not flood the deck

# Linux, include/uapi/linux/input-event-codes.h; written out because evdev is an optional dependency.
EV_SYN, EV_KEY, EV_ABS = 0, 1, 3
SYN_DROPPED = 3
ABS_Y, ABS_HAT0X = 0x01, 0x10


class Button(Enum):
    """The codes of the buttons in use, by their labels on an Xbox gamepad."""

    A, B, X, Y = 0x130, 0x131, 0x133, 0x134
    SHOULDER, START, LEFT, RIGHT = 0x137, 0x13B, 0x222, 0x223


class Stick(NamedTuple):
    """The left stick has moved: -1 is up, 1 is down, 0 is released."""

    y: float


def events(device: InputDevice[str]) -> Iterator[Button | Stick]:
    """Buttons as they are pressed, and positions of the left stick, until the device is unplugged (OSError)."""
    # Where the kernel drops events because they were read too slowly, an emergency stop must not be lost with them: B
    # counts as pressed if it is held down afterwards.
    stick, buttons = device.absinfo(ABS_Y), {button.value: button for button in Button}
    for event in device.read_loop():
        if event.type == EV_KEY and event.value == 1 and event.code in buttons:
            yield buttons[event.code]
        elif event.type == EV_ABS and event.code == ABS_HAT0X and event.value:
            yield Button.RIGHT if event.value > 0 else Button.LEFT
        elif event.type == EV_ABS and event.code == ABS_Y:
            yield Stick(deflection(event.value, stick.min, stick.max))
        elif event.type == EV_SYN and event.code == SYN_DROPPED and Button.B.value in device.active_keys():
            yield Button.B


def deflection(value: int, lowest: int, highest: int) -> float:
    """A stick's value as -1 to 1; the kernel may report values beyond the range that it states."""
    if lowest >= highest:
        return 0.0
    return min(max((2.0 * value - lowest - highest) / (highest - lowest), -1.0), 1.0)


def open_gamepad(path: Path | None) -> InputDevice[str]:
    """The gamepad at a path (/dev/input/event7), or the first one found; MotiondeckError without evdev or gamepad."""
    try:
        import evdev
    except ImportError:
        raise MotiondeckError('a gamepad needs evdev. Install it with: pip install "motiondeck[gamepad]"') from None
    if path is None:
        for device in map(evdev.InputDevice, evdev.list_devices()):
            if _is_gamepad(device.capabilities(absinfo=False)):
                return device
        raise MotiondeckError(
            "there is no gamepad that you may read. Plug one in, or: sudo usermod -aG input $USER, and log in again"
        )
    try:
        device = evdev.InputDevice(str(path))
    except OSError as error:
        raise MotiondeckError(
            f"{path}: no gamepad can be read here ({error.strerror or error}). Without --device the first one is taken"
        ) from None
    if not _is_gamepad(device.capabilities(absinfo=False)):
        raise MotiondeckError(f"{path}: '{device.name}' is not a gamepad. Without --device the first one is taken")
    return device


def _is_gamepad(capabilities: Mapping[int, Sequence[int]]) -> bool:
    """Every gamepad has the south button, by the kernel's specification; the tempo needs a stick besides."""
    return Button.A.value in capabilities.get(EV_KEY, ()) and ABS_Y in capabilities.get(EV_ABS, ())


class Pad:
    """Turns events into commands; the cross of the gamepad steps through the motions in their order."""

    def __init__(self, motions: Sequence[str], motion: str) -> None:
        self._motions = list(motions)
        self._place = self._motions.index(motion)
        self._paused = False
        self._tempo = 1.0

    def command(self, event: Button | Stick) -> DeckCommand | None:
        """The command of an event, or None where it has none."""
        match event:
            case Stick(y):
                if abs((tempo := tempo_of(y)) - self._tempo) < 0.5 * STEP:
                    return None
                self._tempo = tempo
                return commands.SetTempo(tempo)
            case Button.LEFT | Button.RIGHT:
                self._place = (self._place + (1 if event is Button.RIGHT else -1)) % len(self._motions)
                self._paused = False
                return commands.Switch(self._motions[self._place])
            case Button.A:
                self._paused = not self._paused
                return commands.Pause() if self._paused else commands.Resume()
            case Button.B:
                self._paused = True
                return commands.EmergencyStop()
            case Button.X:
                return commands.Home()
            case Button.Y:
                return commands.Reset()
            case Button.SHOULDER:
                return commands.GiveBeat()
            case Button.START:
                return commands.Stop()


def tempo_of(value: float) -> float:
    """The tempo of a stick from -1 (up, fastest) to 1 (down, slowest), in steps of STEP; 1 where it is released."""
    deflection = max(0.0, (abs(value) - DEAD) / (1.0 - DEAD))
    tempo = 1.0 + deflection * ((TEMPO.highest if value < 0.0 else SLOWEST) - 1.0)
    return min(max(round(tempo / STEP) * STEP, SLOWEST), TEMPO.highest)


def drive(device: InputDevice[str], client: CommandClient) -> None:
    """Commands the deck until the gamepad is unplugged; then the deck is paused. SocketError if no deck is running."""
    state = state_of(client)
    pad = Pad(state.motions, state.motion)
    try:
        for event in events(device):
            message = pad.command(event)
            if message is None:
                continue
            reply = client.request(message)
            if isinstance(reply, Refused) or not isinstance(message, commands.SetTempo):
                motion = f" {message.to}" if isinstance(message, commands.Switch) else ""
                print(f"{message.row.word}{motion}: {describe(reply)}", flush=True)
            if isinstance(message, commands.GiveBeat):
                state = client.request(commands.GetStatus())
                if isinstance(state, State) and state.lock is not None:
                    print(state.lock, flush=True)
            if isinstance(message, commands.Stop):
                return
    except OSError:
        pass  # unplugged
    client.request(commands.Pause())
    raise MotiondeckError("the gamepad was unplugged, so the deck was paused")


def gamepad(
    device: Annotated[Path | None, Option(metavar="FILE", help="/dev/input/eventN; default: first gamepad.")] = None,
    command_port: CommandPort = DEFAULT_PORT,
) -> None:
    """Command the running deck with a gamepad.

    On Linux, with the extra `gamepad`: pip install "motiondeck\\[gamepad]". Cross left and right: previous and next
    motion. Left stick: tempo. A: pause and resume. B: emergency stop. Y: reset. X: home. Right shoulder: tap a beat, to
    which the motion is locked. Start: stop. Unplugging the gamepad pauses the deck.

    Example:  motiondeck gamepad
    """
    pad = open_gamepad(device)
    client = CommandClient(command_port)
    try:
        print(
            "cross: motion, left stick: tempo, A: pause, B: emergency stop, Y: reset, X: home, "
            "right shoulder: tap a beat, Start: stop"
        )
        drive(pad, client)
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        client.close()
