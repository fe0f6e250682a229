"""Emulated rigs on a pseudo-terminal, served by a thread: other processes drive servos that the test reaches."""

import threading
from contextlib import contextmanager

from hardware.emulator.bus import EmulatedBus
from hardware.emulator.pty_server import PtyServer, pump


@contextmanager
def served(config, act=lambda bus: None):
    """The emulated servos of a rig and their port; `act` is called with the servos again and again."""
    bus = EmulatedBus(config)
    server = PtyServer(bus)
    over = threading.Event()

    def serve():
        while not over.is_set():
            pump([server])
            act(bus)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield bus, server.port
    finally:
        over.set()
        thread.join()
        server.close()
