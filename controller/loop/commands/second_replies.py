"""Second replies: a switch has settled, or servos have replied."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import msgspec

from controller.loop.commands.client import Client
from controller.loop.commands.commanded_run import refusal
from controller.loop.commands.interfaces import Look, Progress
from controller.wire.messages.commands import DeckCommand
from controller.wire.messages.replies import Refused, SecondReply, Settled

_LOOKED_WITHIN = 15.0  # s, for a look at servos
_MOST_AWAITED = 256  # switches, or looks, whose second reply is still to come


class SecondReplies:
    """Second replies that are pending.

    Attributes:
        switches: those under way, with client, number, motions and progress.
        looks: requests to servos, with client, number and start, s.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self.switches: deque[tuple[Client, int, str, Progress]] = deque(maxlen=_MOST_AWAITED)
        self.looks: deque[tuple[Client, int, Look, float]] = deque(maxlen=_MOST_AWAITED)

    def await_switch(self, client: Client, message: DeckCommand, progress: Progress) -> None:
        """Replies once more when a switch, a queued motion or a blend has settled."""
        self.switches.append((client, message.id, " + ".join(message.motions), progress))

    def await_look(self, client: Client, message: DeckCommand, look: Look) -> None:
        """Replies once more when the servos have replied."""
        self.looks.append((client, message.id, look, self._now()))

    def reply_for_switches(self) -> None:
        """Replies for switches that have settled, were given up or overtaken."""
        for _ in range(len(self.switches)):
            client, number, to, progress = waiting = self.switches.popleft()
            if progress.settled_s is not None:
                client.reply(Settled(to, progress.settled_s - progress.commanded_s, number))
            elif progress.fell_back:
                client.reply(Refused(progress.fell_back, number))
            elif progress.overtaken:
                client.reply(Refused(f"another command has overtaken {to}", number))
            else:
                self.switches.append(waiting)

    def reply_for_looks(self) -> None:
        """Replies with what servos have replied, or that they have not."""
        for _ in range(len(self.looks)):
            client, number, look, began = waiting = self.looks.popleft()
            answer: SecondReply | None
            try:
                answer = look.answer()
            except Exception as error:
                answer = refusal(error, number)
            if answer is None and self._now() - began > _LOOKED_WITHIN:
                answer = Refused("the rig has not answered")
            if answer is None:
                self.looks.append(waiting)
            else:
                client.reply(msgspec.structs.replace(answer, id=number))
