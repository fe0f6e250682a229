"""An emulator in a process of its own, and the maker's client on its pseudo-terminal."""

import dynamixel_sdk as sdk
import pytest

from hardware.emulator.process import start_emulator


@pytest.fixture(scope="module")
def emulator(servo20_file):
    with start_emulator(servo20_file) as emulator:
        yield emulator


@pytest.fixture
def baud():
    """That of the emulator."""
    return 4_000_000


@pytest.fixture
def client(emulator, baud):
    port = sdk.PortHandler(emulator.port)
    port.setBaudRate(baud)
    yield port
    port.closePort()
