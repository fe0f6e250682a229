"""The serial port: held alone, found again by a lasting name, and an error that names the remedy."""

import contextlib
import fcntl
import os
import pty
import struct
import threading

import msgspec
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.port import SerialPort, lasting_name
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import SerialPortError
from hardware.rig.supervision.rig import Rig
from waiting import PATIENCE

_TIOCGEXCL = 0x80045440


@pytest.fixture
def terminal():
    """A pseudo-terminal: the name of the end that a client opens, and its descriptor."""
    master, slave = pty.openpty()
    yield os.ttyname(slave), slave
    os.close(master)
    os.close(slave)


def is_exclusive(descriptor):
    return bool(struct.unpack("i", fcntl.ioctl(descriptor, _TIOCGEXCL, bytes(4)))[0])


def test_a_port_is_exclusive_until_it_is_closed(terminal):
    """A client that asks for no lock, such as dynamixel-sdk, would share the port."""
    name, slave = terminal
    port = SerialPort(name, 1_000_000)
    assert is_exclusive(slave)
    port.close()
    port.close()
    assert not is_exclusive(slave)


@pytest.mark.parametrize(
    ("group", "mode", "said"),
    [
        ("uucp", 0o660, r"Join the group uucp: sudo usermod -a -G uucp \$USER, and log in again"),
        ("uucp", 0o600, r"this helps: sudo chown \$USER /dev/pts/"),
        ("root", 0o660, r"this helps: sudo chown \$USER /dev/pts/"),
    ],
)
def test_permission_denied_names_the_group_to_join_if_that_helps(terminal, monkeypatch, group, mode, said):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    name, slave = terminal
    os.fchmod(slave, mode)
    monkeypatch.setattr("serial.Serial", refuse)
    monkeypatch.setattr("grp.getgrgid", lambda _: type("Group", (), {"gr_name": group}))
    with pytest.raises(SerialPortError, match=said):
        SerialPort(name, 1_000_000)


def test_an_adapter_has_a_lasting_name(terminal, tmp_path):
    name, _ = terminal
    assert lasting_name(name, tmp_path) == name
    assert lasting_name(name, tmp_path / "none") == name
    (tmp_path / "usb-other-port0").symlink_to("/dev/null")
    (tmp_path / "usb-FTDI_U2D2_FT4TFKQ5-port0").symlink_to(name)
    assert lasting_name(name, tmp_path) == str(tmp_path / "usb-FTDI_U2D2_FT4TFKQ5-port0")


def test_a_rig_opens_and_reopens_its_port_by_the_lasting_name(rig_of_four, monkeypatch):
    port, opened = EmulatedPort(EmulatedBus(rig_of_four)), []

    def open_bus(name, baud):
        opened.append(name)
        return Bus(port, baud)

    monkeypatch.setattr("hardware.rig.supervision.rig.lasting_name", {"/dev/ttyUSB0": "by-id/U2D2"}.get)
    monkeypatch.setattr(Bus, "open", open_bus)
    rig = Rig.connect(msgspec.structs.replace(rig_of_four, port="/dev/ttyUSB0"))
    port.unplug()
    rig.request_state()
    port.wire.faults.unplugged = False
    (recovery,) = [thread for thread in threading.enumerate() if thread.name == "rig-recovery"]
    recovery.join()
    assert not rig.collect_state()
    assert rig.recoveries == 1
    assert opened[0] == "by-id/U2D2"
    assert set(opened) == {"by-id/U2D2"}


@pytest.fixture
def linked():
    """A port on a pseudo-terminal and the descriptor of its other end."""
    master, slave = pty.openpty()
    port = SerialPort(os.ttyname(slave), 1_000_000)
    os.close(slave)
    yield port, master
    port.close()
    with contextlib.suppress(OSError):
        os.close(master)


def test_bytes_go_both_ways_and_nothing_waits(linked):
    port, other = linked
    assert (port.receive(), port.wait(0.0), port.wait(-1.0)) == (b"", False, False)
    assert port.send(b"\xff\x00\x11\n")
    assert os.read(other, 100) == b"\xff\x00\x11\n"
    os.write(other, b"\x13\r\x00")
    assert port.wait(PATIENCE)
    assert port.receive() == b"\x13\r\x00"
    assert port.receive() == b""
    began = port.now()
    assert not port.wait(0.02)
    assert port.now() - began >= 0.02


def test_who_wrongly_says_that_something_has_come_is_believed_again_later(linked):
    port, other = linked
    assert port.receive(likely=True) == b""
    assert port.receive(likely=True) == b""
    for _ in range(2):
        os.write(other, b"\x13")
        assert port.wait(PATIENCE)
        assert port.receive(likely=True) == b"\x13"


def test_a_port_that_takes_no_more_bytes_says_so(linked):
    port, _ = linked
    assert not all(port.send(bytes(65536)) for _ in range(20))


@pytest.mark.parametrize(
    "call",
    [
        lambda port: port.send(b"\x00"),
        lambda port: port.receive(),
        lambda port: port.receive(True),
        lambda port: port.wait(1),
    ],
)
@pytest.mark.parametrize("how", ["pulled", "closed"])
def test_a_port_that_is_gone_is_one_clear_error(linked, call, how):
    port, other = linked
    if how == "pulled":
        os.close(other)
    else:
        port.close()
    with pytest.raises(SerialPortError, match=rf"the port {port.name} is gone: plug the adapter in again"):
        call(port)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(16, "Device or resource busy"), "another program is using it. Close that one first"),
        (OSError(11, "Resource temporarily unavailable"), "another program is using it"),
        (OSError("Could not exclusively lock port"), "another program is using it"),
        (OSError(2, "No such file or directory"), "no such device. Plug the adapter in"),
        (ValueError("Invalid baud rate: 3"), "Invalid baud rate: 3"),
        (OSError(5, "Input/output error"), "Input/output error"),
    ],
)
def test_a_port_that_cannot_be_opened_says_why(monkeypatch, error, said):
    def refuse(*_, **__):
        raise error

    monkeypatch.setattr("serial.Serial", refuse)
    with pytest.raises(SerialPortError, match=rf"cannot open the port /dev/x at 9600 baud: .*{said}"):
        SerialPort("/dev/x", 9600)


def test_a_second_program_is_told_that_the_port_is_taken(linked):
    port, _ = linked
    with pytest.raises(SerialPortError, match="another program is using it"):
        SerialPort(port.name, 1_000_000)
