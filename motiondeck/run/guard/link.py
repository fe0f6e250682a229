"""The link between a deck and its guard: a pair of local sockets that carry datagrams, whole and in order."""

import socket
from collections import deque
from typing import Generic, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

_MOST_BYTES = 1 << 18
_MOST_PENDING = 1024  # messages; of more the oldest are dropped
_encoder = msgspec.json.Encoder()

M = TypeVar("M", bound=msgspec.Struct)


class GuardLink(Generic[M]):
    """One end of the pair of sockets; no call waits. Either end notices at once when the other is gone.

    Numbers are sent as they lie in memory, in a multiple of 8 bytes; JSON is padded to any other length. Numbers that
    a full buffer does not take are dropped, as newer ones follow; messages wait.
    """

    def __init__(self, end: socket.socket, decoder: msgspec.json.Decoder[M]) -> None:
        end.setblocking(False)
        self._socket, self._decoder = end, decoder
        self._numbers, self._buffer = memoryview(b""), memoryview(bytearray(_MOST_BYTES))
        self._pending: deque[bytes] = deque(maxlen=_MOST_PENDING)
        self.lost = False  # whether the other end is gone

    def expect(self, numbers: NDArray[np.float64]) -> None:
        """The latest numbers of the other end are put into this array."""
        self._numbers = numbers.data.cast("B")

    def fileno(self) -> int:
        """Readable when something has come, or the other side is gone."""
        return self._socket.fileno()

    def receive(self) -> tuple[int, list[M]]:
        """Takes what has come: how many sets of numbers (the latest is kept), and the messages in order."""
        numbers, messages = 0, list[M]()
        while True:
            try:
                size = self._socket.recv_into(self._buffer)
            except BlockingIOError:
                break
            except OSError:
                size = 0
            if size == 0:
                self.lost = True
                break
            if size == len(self._numbers):
                self._numbers[:] = self._buffer[:size]
                numbers += 1
            elif size % 8:
                messages.append(self._decoder.decode(self._buffer[:size]))
        return numbers, messages

    def send_numbers(self, values: NDArray[np.float64]) -> bool:
        """Sends a set of numbers; whether it was taken."""
        if self._pending:
            self._send_pending()
        return self._send(values.data)

    def send(self, message: msgspec.Struct) -> None:
        """Sends a message, after those that wait."""
        data = _encoder.encode(message)
        self._pending.append(data if len(data) % 8 else data + b" ")
        self._send_pending()

    def close(self) -> None:
        """Closes this end; the other side notices."""
        self._socket.close()
        self.lost = True

    def _send_pending(self) -> None:
        while self._pending and self._send(self._pending[0]):
            self._pending.popleft()

    def _send(self, data: bytes | memoryview) -> bool:
        try:
            self._socket.send(data)
        except BlockingIOError:
            return False
        except OSError:
            self.lost = True
            return False
        return True
