"""The emulator as a child process; in it `main` serves a rig file while its parent lives."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Self

from hardware.errors import MotiondeckError, SerialPortError
from hardware.rig.rig_file import load_rig


class EmulatorProcess:
    """A running emulator; it ends with `stop`, with the `with` block, or with the process that started it."""

    def __init__(self, process: subprocess.Popen[str], ports: list[str]) -> None:
        self._process, self.pid = process, process.pid
        self.ports, self.port = ports, ports[0]  # what a client opens, in the order of the rig's ports; the first

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Ends the emulator; may be called twice."""
        self._process.kill()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()


def start_emulator(path: str | Path) -> EmulatorProcess:
    """Emulates the rig of a rig file in a child process; raises SerialPortError if that does not start."""
    config = load_rig(path)
    command = [sys.executable, "-P", "-m", "hardware.emulator.process", str(path)]
    # In another session: Ctrl-C is for the deck, which still needs its servos to come to rest.
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    ports = [process.stdout.readline().strip() for _ in config.ports] if process.stdout is not None else [""]
    emulator = EmulatorProcess(process, ports)
    if not all(ports):
        emulator.stop()
        raise SerialPortError(f"the emulator for {path} did not start; its message stands above.")
    return emulator


def main(rig: str) -> int:
    """Serves a rig file and prints its ports; returns 0, or 1 if the file cannot be used."""
    from hardware.emulator.pty_server import serve

    parent = os.getppid()
    try:
        serve(load_rig(rig), lambda port: print(port, flush=True), goes_on=lambda: os.getppid() == parent)
    except MotiondeckError as error:
        print(f"motiondeck: {error}", file=sys.stderr)
        return 1
    except (KeyboardInterrupt, BrokenPipeError):
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
