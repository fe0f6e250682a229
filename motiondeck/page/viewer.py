"""The process of the page: the moving robot, a button for each motion, and the figures of the loop.

Runs as a separate process (`python -m motiondeck.page.viewer`), reads the latest state from shared memory and sends
commands over a socket, so that nothing it does can hold up the loop.
"""

import contextlib
import os
import shutil
import sys
import time
from collections.abc import Mapping
from pathlib import Path

# The page draws; this process needs no OpenGL, and starts sooner without.
os.environ.setdefault("MUJOCO_GL", "disable")

import msgspec
import numpy as np

from controller.motion.rotations import Array
from controller.wire.command_socket import CommandClient
from controller.wire.messages.commands import Subscribe
from controller.wire.messages.replies import Event
from controller.wire.run_folder import REASON_FILE
from controller.wire.snapshot_numbers import SnapshotNumbers
from controller.wire.telemetry import StateReader, named
from motiondeck.page.deck_view import DeckView
from motiondeck.page.web.page_state import PageDescription, Picture, PictureArrays
from motiondeck.page.web.private_page import served
from motiondeck.page.web.state_line import FAULT, StateLine
from motiondeck_base.errors import MotiondeckError

PICTURES_PER_SECOND = 25.0  # of 50, 100 or 200 ticks: as many between any two pictures
SILENT = 2.0  # s without a tick, after which a deck does not answer
LONGEST_WAIT = 600.0  # s for a deck that is starting, perhaps with a large robot on a busy machine


def view(state: Path, command_port: int | None, port: int) -> None:
    """Shows a deck until it ends or the process that started this one is gone; waits for its state file to appear.

    Prints the address of the page on standard error as soon as that answers. Without a command port, the state file
    says it. MotiondeckError if there is no such deck, or the port is taken.
    """
    parent = os.getppid()
    # The deck starts this process first and loads its robot meanwhile, so that the page is there sooner.
    latest_start = time.monotonic() + LONGEST_WAIT
    while not state.exists() and os.getppid() == parent and time.monotonic() < latest_start:
        time.sleep(0.01)
    reader = StateReader(state)
    about = msgspec.convert(reader.description, PageDescription)
    numbers = SnapshotNumbers(about.motions, recognizable=about.recognizable, joints=about.joints)

    def picture(shared: Mapping[str, Array]) -> Picture:
        return Picture(numbers.read(shared), PictureArrays.over(shared, about.shapes))

    command_port = about.command_port if command_port is None else command_port
    try:
        with served(port, f"Motiondeck · {about.robot}") as page:
            print(f"page: {page.address}", file=sys.stderr, flush=True)
            shown = DeckView(page, about, CommandClient(command_port), state.parent / "dropped")
            events = CommandClient(command_port)
            with contextlib.suppress(MotiondeckError):
                events.post(Subscribe())
            last_tick, last_state, heard = -1.0, 0, time.monotonic()
            while not reader.ended and os.getppid() == parent:
                now = time.monotonic()
                latest = reader.read()
                if latest is not None and latest["tick"][0] != last_tick and np.isfinite(latest["qpos"]).all():
                    last_tick, heard = latest["tick"][0], now
                    shown.show(picture(latest), now)
                elif last_tick >= 0.0 and now - heard > SILENT:
                    of = f"of the deck for {now - heard:.0f} s"  # the guard of a rig is another process
                    held = "the rig is held; a stop still reaches it" if about.rig else "a stop acts once it goes on"
                    shown.panel.show_line(StateLine("NO ANSWER", of, held, FAULT))
                if (hands := shown.hands) is not None and hands.recording:
                    # More states are published than pictures drawn.
                    last_state, values = reader.since(last_state or reader.latest - 1)
                    for each in values:
                        seen = picture(named(each, reader.fields))
                        if seen.servos is not None:
                            hands.record(seen.snapshot.run_s, seen.servos)
                else:
                    last_state = 0
                with contextlib.suppress(MotiondeckError):  # it may just have ended
                    while (reply := events.receive(0.0)) is not None:
                        if isinstance(reply, Event):
                            shown.show_event(reply)
                time.sleep(max(0.0, now + 1.0 / PICTURES_PER_SECOND - time.monotonic()))
            shown.end(_reason(state))
    finally:
        if os.getppid() != parent and state.parent.name.startswith("motiondeck-"):
            # A deck that was killed could not tidy up after itself.
            shutil.rmtree(state.parent, ignore_errors=True)


def _reason(state: Path) -> str:
    try:
        return state.with_name(REASON_FILE).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def main(state: str, port: str, command_port: str | None = None) -> int:
    """The command line of the view's process: the deck's shared state file, and ports; returns its exit code."""
    try:
        view(Path(state), None if command_port is None else int(command_port), int(port))
    except MotiondeckError as error:
        print(f"motiondeck: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
