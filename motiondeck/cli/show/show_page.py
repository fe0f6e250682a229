"""The process of a show's page: receives the state of the show, and sends its buttons as typed words.

A pair of connected sockets leads there and back. Nothing listens for either, no other program can find them, and
each side notices at once when the other has ended. Neither waits for the other: what there is no room for is dropped.
"""

import contextlib
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec

from motiondeck.run.beside.child_process import child_process, free_port
from motiondeck.shows.show_state import ShowNotice, ShowState

_MOST_BYTES = 256  # of a word


class ShowPage:
    """The conductor's end."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._connection = connection

    def fileno(self) -> int:
        """Readable when a button was pressed, for `select`."""
        return self._connection.fileno()

    def words(self) -> Iterator[str]:
        """The words of its buttons; raises an EOFError if the page has ended."""
        try:
            while data := self._connection.recv(_MOST_BYTES):
                yield data.decode(errors="replace")
        except BlockingIOError:
            return
        except ConnectionResetError:
            pass  # it was killed, and has not read a state
        raise EOFError

    def show(self, news: ShowState | ShowNotice) -> None:
        """Sends a state or a notice."""
        with contextlib.suppress(OSError):
            self._connection.send(msgspec.json.encode(news))


@contextmanager
def show_page(port: int) -> Iterator[ShowPage]:
    """The page while the block runs, on 127.0.0.1, at any free port for 0; MotiondeckError if the port is taken."""
    port = free_port(port)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with (
        theirs,
        child_process("motiondeck.page.show.viewer", "--port", str(port), stdin=theirs.fileno(), own_session=True),
    ):
        theirs.close()
        with ours:
            yield ShowPage(ours)
