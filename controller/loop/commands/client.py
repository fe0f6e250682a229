"""A client of the command sockets, and how to reach it."""

from __future__ import annotations

from typing import NamedTuple

from controller.wire.command_socket import Address, CommandServer
from controller.wire.messages.replies import Reply


class Client(NamedTuple):
    """Who has sent a command, and to which socket."""

    server: CommandServer
    sender: Address

    @property
    def connected(self) -> bool:
        """Whether it is still there, as far as its socket can tell."""
        return self.server.connected(self.sender)

    def reply(self, reply: Reply) -> None:
        """Sends it a reply or an event; it never waits."""
        self.server.reply(self.sender, reply)
