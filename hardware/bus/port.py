"""The serial port of a bus: waits in poll(), never in a busy loop."""

# ruff: noqa: D102 (`SerialPort` documents what the methods of a `Port` do)

import contextlib
import errno
import fcntl
import os
import select
import termios
import time
from array import array
from pathlib import Path
from typing import Protocol

import serial

from hardware.errors import SerialPortError
from hardware.families.family import Family
from hardware.families.frames import BROADCAST

_AT_ONCE = 4096  # bytes; what is more waits for the next call
_BY_ID = Path("/dev/serial/by-id")


class Port(Protocol):
    """The interface between a bus and its port. Any call may raise SerialPortError when the device is gone."""

    name: str

    def send(self, data: bytes) -> bool: ...
    def receive(self, likely: bool = False) -> bytes: ...
    def wait(self, seconds: float) -> bool: ...
    def now(self) -> float: ...  # the time on the clock of `wait`, s
    def close(self) -> None: ...


class SerialPort:
    """A serial device, held exclusively, 8N1.

    A lock keeps out programs that ask for one, and TIOCEXCL all others: a second client that opens the port, such as
    dynamixel-sdk, is refused by the system. (root is not.)
    """

    now = staticmethod(time.monotonic)

    def __init__(self, name: str, baud: int) -> None:
        self.name = name
        try:
            self._serial = serial.Serial(name, baud, timeout=0, exclusive=True)
            fcntl.ioctl(self._serial.fileno(), termios.TIOCEXCL)
        except (OSError, ValueError) as error:
            raise SerialPortError(f"cannot open the port {name} at {baud} baud: {_reason(name, error)}") from error
        self._fd = self._serial.fileno()
        self._available = array("i", [0])  # bytes that wait in the kernel
        self._ready = False  # whether the last wait has seen some
        self._trusts = True  # whether `likely` was right the last time
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)

    def send(self, data: bytes) -> bool:
        """Hands the bytes over without waiting; False if the device would not take them all."""
        try:
            return os.write(self._fd, data) == len(data)
        except BlockingIOError:
            return False
        except OSError as error:
            raise self._vanished() from error

    def receive(self, likely: bool = False) -> bytes:
        """The bytes received since the last call, without waiting; `likely` if some have come."""
        # read() and poll() on an empty pseudo-terminal wait for a kernel worker that may bring something: on a busy
        # machine for milliseconds, even with real-time priority. Asking for the number of bytes does not, but takes
        # time itself: where bytes are `likely`, they are just read, until that was wrong once.
        try:
            if self._ready or (likely and self._trusts):
                data = os.read(self._fd, _AT_ONCE)
                self._ready, self._trusts = False, bool(data)
                if data:
                    return data
            fcntl.ioctl(self._fd, termios.FIONREAD, self._available)
            return os.read(self._fd, _AT_ONCE) if self._available[0] else b""
        except BlockingIOError:
            self._ready = self._trusts = False
            return b""
        except (OSError, ValueError) as error:  # a ValueError for the descriptor of a port that is closed
            raise self._vanished() from error

    def wait(self, seconds: float) -> bool:
        """Sleeps until bytes can be received, at most `seconds`; whether they can."""
        if self._fd < 0:
            raise self._vanished()
        events = self._poll.poll(max(0.0, seconds) * 1e3)
        if events and events[0][1] & (select.POLLHUP | select.POLLERR | select.POLLNVAL):
            raise self._vanished()
        self._ready = bool(events)
        return self._ready

    def close(self) -> None:
        """Closes the device; may be called twice, and afterwards every other call raises SerialPortError."""
        # The number may belong to another file soon: no byte meant for servos may reach that.
        if self._fd >= 0:
            # On a pseudo-terminal the other end stays open, and with it this setting.
            with contextlib.suppress(OSError):
                fcntl.ioctl(self._fd, termios.TIOCNXCL)
        self._fd = -1
        self._serial.close()

    def _vanished(self) -> SerialPortError:
        return SerialPortError(f"the port {self.name} is gone: plug the adapter in again and start anew.")


def lasting_name(name: str, folder: Path = _BY_ID) -> str:
    """The name of a port that its adapter keeps when plugged in again: its link in /dev/serial/by-id, if it has one."""
    try:
        links = sorted(folder.iterdir())
        return next((str(link) for link in links if link.resolve() == Path(name).resolve()), name)
    except OSError:
        return name


def _reason(name: str, error: OSError | ValueError) -> str:
    number = getattr(error, "errno", None)
    if "exclusively lock" in str(error) or number in (errno.EBUSY, errno.EAGAIN):
        return "another program is using it. Close that one first."
    if number == errno.ENOENT:
        return "there is no such device. Plug the adapter in, or name its port."
    if number == errno.EACCES:
        return f"permission denied. {_right_to_open(name)}"
    if number in (errno.EISDIR, errno.ENOTTY) or "Inappropriate ioctl" in str(error):
        return "this is no serial port. Name the adapter's, such as /dev/ttyUSB0."
    return str(error)


def _right_to_open(name: str) -> str:
    """How a user gets the right to open a device: by its group, if that may read and write it."""
    device, group = Path(name), "dialout"  # the usual one, where that cannot be found out
    with contextlib.suppress(OSError, KeyError):
        if device.stat().st_mode & 0o060 != 0o060 or device.group() == "root":
            return f"Until it is plugged in again this helps: sudo chown $USER {name}"
        group = device.group()
    return f"Join the group {group}: sudo usermod -a -G {group} $USER, and log in again."


def returns_what_is_sent(port: Port, family: Family, patience: float) -> bool:
    """Whether the port has an echo, found out by a frame that no servo answers; waits twice `patience`, s."""
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
    """A port as it would be without its echo: where driver and receiver share one line, all that is sent comes back.

    In some families an instruction looks like an answer (`Family.mirrors`), and every ping would look answered.
    """

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
