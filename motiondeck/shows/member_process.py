"""The process in which a deck takes part in a show; `motiondeck play --show` starts it."""

import os
import sys

from controller.wire.command_socket import CommandClient, CommandServer, SocketError
from motiondeck.shows.known_stops import StopMemory
from motiondeck.shows.link import Link
from motiondeck.shows.member import Member
from motiondeck.shows.membership import deck_in
from motiondeck.shows.messages import About, read
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.words import printable

_LOOK = 1.0  # s


def main(show: str, command_port: str, leader_port: str, about_deck: str) -> int:
    """Takes part until the deck has ended; the exit code.

    Args:
        show: SHOW/DECK, or a folder with certificates.
        command_port: of the deck.
        leader_port: where the deck asks for the show's phase.
        about_deck: an `About`, JSON.
    """
    about = read(about_deck.encode(), About)
    assert about is not None, "written by the deck"
    try:
        membership = deck_in(show)
        deck, leader = CommandClient(int(command_port)), CommandServer(int(leader_port))
        memory = StopMemory(membership.memory)
        member = Member(membership.name, about, Link(membership), deck, leader, _tell, memory=memory)
    except MotiondeckError as error:
        _tell(str(error))
        return 1
    try:
        while member.step(_LOOK):
            pass
    except SocketError:
        # The deck is gone. Closing lost links takes up to 10 s, in which a deck started anew would not get the address.
        os._exit(0)
    finally:
        member.close()
        leader.close()
        deck.close()
    return 0


def _tell(text: str) -> None:
    print(f"motiondeck: show: {printable(text)}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
