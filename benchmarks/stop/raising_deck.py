"""A deck whose commands all raise, whatever they are, from SIGUSR1 on; else it is `motiondeck` as it is."""

from __future__ import annotations

import signal
from types import FrameType

from controller.loop.commands.command_handler import CommandHandler
from controller.loop.stop_requests import StopRequest
from motiondeck.cli.main import main as motiondeck


def main() -> None:
    """Runs the command line."""
    carry_out, raising = CommandHandler.__call__, False

    def raise_from_now_on(number: int, frame: FrameType | None) -> None:
        nonlocal raising
        raising = True

    def perhaps(handler: CommandHandler, stop: StopRequest) -> None:
        if raising:
            raise OSError("commands raise")
        carry_out(handler, stop)

    CommandHandler.__call__ = perhaps
    signal.signal(signal.SIGUSR1, raise_from_now_on)
    motiondeck()
