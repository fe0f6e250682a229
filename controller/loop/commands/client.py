"""The sender of a command."""

from __future__ import annotations

from typing import NamedTuple

from controller.wire.command_socket import Address, CommandServer
from controller.wire.messages.replies import Reply


class Client(NamedTuple):
    """The sender of a command, and the socket that received it."""

    server: CommandServer
    sender: Address

    @property
    def connected(self) -> bool:
        """Whether it is connected, as far as its socket knows."""
        return self.server.connected(self.sender)

    def reply(self, reply: Reply) -> None:
        """Sends it a reply or an event; it never waits."""
        self.server.reply(self.sender, reply)
