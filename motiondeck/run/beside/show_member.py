"""A deck's part in a show: starts the process that takes part, and lets the deck keep step with it."""

import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from importlib.util import find_spec

import msgspec

from controller.library.motion_library import MotionLibrary
from controller.wire.command_socket import CommandClient, CommandServer, SocketError
from controller.wire.leader_link import LeaderLink
from controller.wire.messages.commands import GetPhase
from controller.wire.messages.replies import PhaseNow
from motiondeck.run.beside.child_process import child_process
from motiondeck.shows.membership import deck_in
from motiondeck.shows.messages import About
from motiondeck_base.errors import MotiondeckError

_OPENS_WITHIN = 20.0  # s, of which up to 10 are for links to the other members
_ANSWERS_WITHIN = 0.5  # s


class ShowMember:
    """The process through which a deck takes part in a show."""

    def __init__(self, process: subprocess.Popen[bytes], leader_port: int) -> None:
        self.process, self._port = process, leader_port

    def leader(self, opening: ExitStack) -> LeaderLink:
        """Waits until it takes part, and has stopped the deck if a stop stands; a link to the phase of the show.

        `opening` closes the link. MotiondeckError if it cannot take part; the process has said why.
        """
        client = CommandClient(self._port)
        until = time.monotonic() + _OPENS_WITHIN
        while True:
            try:
                client.post(GetPhase())
                if isinstance(client.receive(_ANSWERS_WITHIN), PhaseNow):
                    break
            except SocketError:
                pass  # it is still starting
            if self.process.poll() is not None or time.monotonic() > until:
                raise MotiondeckError("the deck cannot take part in the show: see above")
            time.sleep(0.02)
        client.close()
        return opening.enter_context(closing(LeaderLink.to(str(self._port))))


@contextmanager
def show_member(show: str, command_port: int, library: MotionLibrary, robot: str, rate: float) -> Iterator[ShowMember]:
    """Takes part in a show (SHOW/DECK, or certificates) in the block, as the deck of that port, or MotiondeckError."""
    deck_in(show)
    if find_spec("zenoh") is None:
        raise MotiondeckError("a show needs Eclipse zenoh: pip install 'motiondeck[fleet]'")
    free = CommandServer(0)
    port = free.port
    free.close()
    frames = library.info.rate
    rounds = {motion.name: motion.frames / frames if motion.plays == "loop" else 0.0 for motion in library.info.motions}
    about = msgspec.json.encode(About(robot, library.info.name, rate, rounds, socket.gethostname())).decode()
    arguments = show, str(command_port), str(port), about
    with child_process("motiondeck.shows.member_process", *arguments, own_session=True) as process:
        yield ShowMember(process, port)
