"""The serial port: held alone, found again by a lasting name, and an error that names the remedy."""

import fcntl
import os
import pty
import struct

import msgspec
import pytest

from hardware.bus.port import SerialPort, lasting_name
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.port import EmulatedPort
from hardware.errors import SerialPortError
from hardware.rig.supervised_rig import SupervisedRig

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


def test_permission_denied_names_the_group_to_join(terminal, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("serial.Serial", refuse)
    monkeypatch.setattr("grp.getgrgid", lambda _: type("Group", (), {"gr_name": "uucp"}))
    with pytest.raises(SerialPortError, match=r"Join the group uucp: sudo usermod -a -G uucp \$USER"):
        SerialPort(terminal[0], 1_000_000)


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

    monkeypatch.setattr("hardware.rig.supervised_rig.lasting_name", {"/dev/ttyUSB0": "by-id/U2D2"}.get)
    monkeypatch.setattr(Bus, "open", open_bus)
    rig = SupervisedRig.connect(msgspec.structs.replace(rig_of_four, port="/dev/ttyUSB0"))
    port.unplug()
    rig.request_state()
    port.plug_in()
    rig._job.join()
    assert not rig.collect_state()
    assert rig.recoveries == 1
    assert opened[0] == "by-id/U2D2"
    assert set(opened) == {"by-id/U2D2"}
