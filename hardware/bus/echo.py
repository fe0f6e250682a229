"""Adapters with an echo: what is sent comes back in front of the answers, and is dropped.

Where driver and receiver of an adapter share one line, every byte that it sends is received too. In some families an
instruction looks like an answer (`Family.mirrors`), and every ping would look answered.
"""

from hardware.bus.port import Port
from hardware.families.family import Family
from hardware.families.frames import BROADCAST


def returns_what_is_sent(port: Port, family: Family, patience: float) -> bool:
    """Whether the port is such an adapter, found out by a frame that no servo answers; waits twice `patience`, s."""
    probe = family.instructions.read(BROADCAST, 0, 1)  # nothing answers a read that is addressed to all
    while port.wait(patience):
        port.receive()
    if not port.send(probe):
        return False
    received, end = b"", port.now() + patience
    while len(received) < len(probe) and (left := end - port.now()) > 0.0 and port.wait(left):
        received += port.receive()
    return received.startswith(probe)


class WithoutEcho:
    """A port as it would be without its echo."""

    def __init__(self, port: Port) -> None:
        self.name = port.name  # of the port behind it
        self.now = port.now
        self._port = port
        self._sent = bytearray()  # and not come back yet
        self._received = b""

    def send(self, data: bytes) -> bool:
        """As the port's; the same bytes are dropped when they come back."""
        if not self._port.send(data):
            return False
        self._sent += data
        return True

    def receive(self, likely: bool = False) -> bytes:
        """As the port's, without what was sent."""
        received = self._received + self._without_echo(self._port.receive(likely))
        self._received = b""
        return received

    def wait(self, seconds: float) -> bool:
        """As the port's; an echo is nothing to be received."""
        end = self.now() + seconds
        while not self._received and self._port.wait(max(0.0, end - self.now())):
            self._received = self._without_echo(self._port.receive())
        return bool(self._received)

    def close(self) -> None:
        """Closes the port."""
        self._port.close()

    def _without_echo(self, received: bytes) -> bytes:
        echo = 0
        while echo < min(len(received), len(self._sent)) and received[echo] == self._sent[echo]:
            echo += 1
        # What comes back damaged is left to the parser; from then on every byte is taken for an answer.
        self._sent = self._sent[echo:] if echo == len(received) else bytearray()
        return received[echo:]
