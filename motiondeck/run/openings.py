"""What a run opens besides robots and page: the sockets of its commands, its lock and its recording."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from controller.deck.lockable import Lockable
from controller.wire.command_socket import CommandServer
from controller.wire.leader_link import LeaderLink
from motiondeck.run.beside.tick_recorder import TickRecorder, recording
from motiondeck.run.robots.robot_on_deck import RobotOnDeck
from motiondeck_base.errors import MotiondeckError


def open_servers(
    opening: ExitStack, port: int, listen: str | None, token: bytes | None
) -> tuple[list[CommandServer], int]:
    """The sockets where commands are taken, and their port.

    Args:
        opening: closes them.
        port: the command port, or 0 for a free one.
        listen: the address of another interface, where the token is needed.
        token: who has it may command from there.

    Raises:
        SocketError: if the port or the address cannot be used.
    """
    servers = list[CommandServer]()
    # A network knows which ports are free; the local socket then has the same number.
    if listen is not None:
        servers.append(CommandServer(port, listen, token))
        opening.callback(servers[0].close)
        port = servers[0].port
    servers.append(CommandServer(port))
    opening.callback(servers[-1].close)
    return servers, servers[-1].port


def lock_deck(opening: ExitStack, deck: Lockable, source: str | None) -> None:
    """Locks a deck to beats, to its body or to the deck on a command port, if anything is given.

    Raises:
        MotiondeckError: if the network has no phase, or there is no such deck.
    """
    if source is None:
        return
    if source in ("beat", "body"):
        deck.lock(source)
        return
    link = LeaderLink.to(source)
    opening.callback(link.close)
    deck.leader = link
    deck.lock("deck")


def open_recorder(
    opening: ExitStack,
    file: Path,
    robot: RobotOnDeck,
    played: str,
    motions: Sequence[str],
    recognizable: Sequence[str],
    rate: float,
) -> TickRecorder:
    """Starts the recording of a robot that plays the motions of a library (or a run) named `played` at a rate, Hz.

    Of motions that are recognized, the names are kept too.

    Raises:
        MotiondeckError: if the robot is not simulated, or the file cannot be written.
    """
    simulation = robot.simulation
    if simulation is None:
        raise MotiondeckError("a rig without a simulated robot cannot be recorded; use: motiondeck play --record")
    joints = list(robot.own_joints)
    description = {
        "library": played,
        "robot": robot.name,
        "joints": joints,
        "motions": list(motions),
        "recognizable": list(recognizable),
        "rate": rate,
        "root": simulation.root,
        "balance": simulation.balance,
        "walk": simulation.walk,
    }
    return opening.enter_context(recording(file, description, rate))
