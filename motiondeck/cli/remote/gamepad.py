"""`motiondeck gamepad`: commands a running deck with a gamepad."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from controller.wire.command_socket import DEFAULT_PORT, CommandClient
from controller.wire.messages import commands
from controller.wire.messages.arguments import TEMPO
from controller.wire.messages.commands import DeckCommand
from controller.wire.messages.replies import Refused, State
from motiondeck.cli.remote.gamepad_device import Button, Stick, events, open_gamepad
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from evdev import InputDevice

SLOWEST = 0.1  # the tempo of the stick when it is pulled all the way down
DEAD = 0.15  # deflections of the stick up to this share of the full one count as released
STEP = 0.1  # tempos are sent in such steps, so that a hand on the stick does not flood the deck


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
                return self._set_tempo(tempo_of(y))
            case Button.LEFT:
                return self._switch(-1)
            case Button.RIGHT:
                return self._switch(1)
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

    def _switch(self, step: int) -> DeckCommand:
        self._place = (self._place + step) % len(self._motions)
        self._paused = False
        return commands.Switch(self._motions[self._place])

    def _set_tempo(self, tempo: float) -> DeckCommand | None:
        if abs(tempo - self._tempo) < 0.5 * STEP:
            return None
        self._tempo = tempo
        return commands.SetTempo(tempo)


def tempo_of(value: float) -> float:
    """The tempo of a stick from -1 (up, fastest) to 1 (down, slowest), in steps of STEP; 1 where it is released."""
    deflection = max(0.0, (abs(value) - DEAD) / (1.0 - DEAD))
    tempo = 1.0 + deflection * ((TEMPO.highest if value < 0.0 else SLOWEST) - 1.0)
    return min(max(round(tempo / STEP) * STEP, SLOWEST), TEMPO.highest)


def drive(device: InputDevice[str], client: CommandClient) -> None:
    """Commands the deck until the gamepad is unplugged; then the deck is paused. SocketError if no deck is running."""
    from motiondeck.run.terminal import describe

    state = client.request(commands.GetStatus())
    if not isinstance(state, State):
        raise MotiondeckError(f"the deck did not report what it plays: {describe(state)}")
    pad = Pad(state.motions, state.motion)
    try:
        for event in events(device):
            message = pad.command(event)
            if message is None:
                continue
            reply = client.request(message)
            if isinstance(reply, Refused) or not isinstance(message, commands.SetTempo):
                print(f"{_typed(message)}: {describe(reply)}", flush=True)
            if isinstance(message, commands.GiveBeat):
                _print_lock(client)
            if isinstance(message, commands.Stop):
                return
    except OSError:
        pass  # unplugged
    client.request(commands.Pause())
    raise MotiondeckError("the gamepad was unplugged, so the deck was paused")


def _print_lock(client: CommandClient) -> None:
    state = client.request(commands.GetStatus())
    if isinstance(state, State) and state.lock is not None:
        print(state.lock, flush=True)


def _typed(message: DeckCommand) -> str:
    word = message.row.word
    return f"{word} {message.to}" if isinstance(message, commands.Switch) else word


def gamepad(
    device: Annotated[
        Path | None, Option(metavar="FILE", help="A device such as /dev/input/event7; default: the first gamepad.")
    ] = None,
    command_port: Annotated[int, Option(metavar="PORT", help="The deck's command port.")] = DEFAULT_PORT,
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
