"""Threads that take turns in simulated time, so that what they do together comes out the same every time.

The main thread lets time pass. Any other runs only while the main thread gives it its turn, and hands it back when it
waits for a later time, or ends.
"""

from __future__ import annotations

import math
import threading

_LOOK = 0.002  # s, real time, from one look at whether a thread has ended to the next


class Turns:
    """The threads called `name`, and the main one, which makes this.

    Attributes:
        free: whether the others need no turns any more, because the main thread waits for their ends.
    """

    def __init__(self, name: str) -> None:
        self.free = False
        self._name = name
        self._main = threading.current_thread()
        self._changed = threading.Condition()
        self._due: dict[threading.Thread, float] = {}  # the time that each thread waits for
        self._running: threading.Thread | None = None
        self._over = False

    @property
    def is_other(self) -> bool:
        """Whether the calling thread is not the main one, and must wait for its turns."""
        return not self.free and threading.current_thread() is not self._main

    @property
    def has_turn(self) -> bool:
        """Whether it is the calling thread's turn."""
        return self._running is threading.current_thread()

    def wait_until(self, time: float) -> None:
        """Ends the turn of the calling thread until the simulated time `time`, s.

        Raises:
            SystemExit: if its end is no longer wanted; it ends the thread silently.
        """
        me = threading.current_thread()
        with self._changed:
            self._due[me], self._running = time, None
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._running is me or self.free or self._over)
        if self._over:
            raise SystemExit

    def next_due(self) -> float:
        """The earliest time that another thread waits for, s; infinite while there is none. For the main thread."""
        with self._changed:
            while any(thread not in self._due for thread in self._others()):
                self._changed.wait(_LOOK)  # it has begun a moment ago
            return min((self._due[thread] for thread in self._others()), default=math.inf)

    def give(self, time: float) -> bool:
        """Gives each thread that waits for a time up to `time` its turn, and waits for its end; False for none."""
        with self._changed:
            ready = [thread for thread in self._others() if self._due.get(thread, math.inf) <= time]
            for thread in ready:
                del self._due[thread]
                self._running = thread
                self._changed.notify_all()
                while thread not in self._due and thread.is_alive():
                    self._changed.wait(_LOOK)
            self._running = None
        return bool(ready)

    def set_free(self) -> None:
        """Lets all threads run on without turns."""
        with self._changed:
            self.free = True
            self._changed.notify_all()

    def abandon(self) -> None:
        """Ends all threads; SystemExit ends them silently by Python's own hook, but not by that of a test's runner."""
        hook, threading.excepthook = threading.excepthook, threading.__excepthook__
        with self._changed:
            self._over = True
            self._changed.notify_all()
        for thread in self._others():
            thread.join()
        threading.excepthook = hook

    def _others(self) -> list[threading.Thread]:
        return [thread for thread in threading.enumerate() if thread.name == self._name]
