"""What comes in by threads, for a loop that waits for it by `select`."""

import os
from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Holds what has come in, oldest first; of too much the oldest is lost."""

    def __init__(self, most: int = 1024) -> None:
        self._held: deque[T] = deque(maxlen=most)
        self._flag = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._closed = False

    def fileno(self) -> int:
        """Readable while something is in it."""
        return self._flag

    def put(self, thing: T) -> None:
        """Puts something in, from any thread."""
        self._held.append(thing)
        if not self._closed:
            os.eventfd_write(self._flag, 1)

    def take(self) -> Iterator[T]:
        """Takes out what there is."""
        try:
            os.eventfd_read(self._flag)
        except BlockingIOError:
            return
        while self._held:
            yield self._held.popleft()

    def close(self) -> None:
        """Nothing is waited for any more; may be called twice."""
        if not self._closed:
            self._closed = True
            os.close(self._flag)
