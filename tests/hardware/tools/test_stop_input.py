"""A wired emergency stop: pulled by a contact, a key, a cut wire or an unplugged device."""

import os
import pty
from pathlib import Path

import pytest

from hardware.tools import stop_input
from hardware.tools.stop_input import StopInput, key_reader, open_stop_input
from motiondeck_base.errors import MotiondeckError


@pytest.fixture(autouse=True)
def by_hand(monkeypatch):
    """The thread asks nothing by itself."""
    monkeypatch.setattr(stop_input, "ASKED_EVERY", 1000.0)


def test_an_open_contact_and_one_that_cannot_be_asked_are_pulled():
    answers = iter([True, False, False, True, OSError("unplugged")])

    def closed():
        answer = next(answers)
        if isinstance(answer, OSError):
            raise answer
        return answer

    stop = StopInput("ttyUSB0", closed, lambda: None)
    seen = []
    for _ in range(5):
        stop.look()
        seen.append((stop.pulled, stop.pulls))
    assert seen == [(False, 0), (True, 1), (True, 1), (False, 1), (True, 2)]
    stop.close()
    stop.close()


class Adapter:
    """A serial adapter with a contact between DTR and CTS."""

    connected = True

    def __init__(self, name, exclusive):
        self.dtr = False

    @property
    def cts(self):
        return self.dtr and self.connected

    def close(self):
        pass


def test_a_contact_connects_dtr_with_cts_while_all_is_well(monkeypatch):
    monkeypatch.setattr("serial.Serial", Adapter)
    stop = open_stop_input(Path("/dev/ttyUSB9"))
    stop.look()
    assert not stop.pulled
    monkeypatch.setattr(Adapter, "connected", False)
    stop.look()
    assert stop.pulled
    stop.close()
    with pytest.raises(MotiondeckError, match="/dev/ttyUSB9: the emergency stop is pulled"):
        open_stop_input(Path("/dev/ttyUSB9"))


@pytest.mark.parametrize("device", ["/dev/input/event9999", "/dev/ttyNONE"])
def test_a_device_that_is_not_there_is_named(device):
    with pytest.raises(MotiondeckError, match=f"{device}: cannot be read"):
        open_stop_input(Path(device))


def test_a_key_pulls_and_a_device_that_is_gone_raises():
    reading, writing = os.pipe()
    os.set_blocking(reading, False)
    closed = key_reader(reading)
    assert closed()
    press, release, motion = (stop_input._EVENT.pack(0, 0, kind, 28, value) for kind, value in ((1, 1), (1, 0), (3, 1)))
    os.write(writing, motion)
    assert closed()
    os.write(writing, press + release)  # let go again before anybody looked
    assert not closed()
    assert closed()
    os.close(writing)
    with pytest.raises(OSError, match="gone"):
        closed()
    os.close(reading)


def test_a_pseudo_terminal_has_no_contact_and_is_refused():
    """Linux gives a pty no DTR and CTS, so that a real contact is tested with a stand-in for pyserial alone."""
    ours, theirs = pty.openpty()
    device = os.ttyname(theirs)
    with pytest.raises(MotiondeckError, match=f"{device}: cannot be read"):
        open_stop_input(Path(device))
    os.close(theirs)
    os.close(ours)
