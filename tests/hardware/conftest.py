import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import RigConfig, RigJoint
from motiondeck_base.shipped import shipped_configs


@pytest.fixture(scope="session")
def servo20_file():
    return shipped_configs() / "rigs" / "servo20.toml"


@pytest.fixture
def rig_of_four():
    """Four joints, ids 1 to 4; the second is mounted the other way round and the third has its zero elsewhere."""

    def joint(id, direction=1, zero=2048, lower=-1.5, upper=1.5):
        return RigJoint(f"joint_{id}", id, "XM430-W350", direction, zero, lower, upper, velocity=4.0)

    return RigConfig(
        "emulated", 1_000_000, 100.0, (joint(1), joint(2, direction=-1), joint(3, zero=1500, lower=-1.0), joint(4))
    )


@pytest.fixture
def port(rig_of_four):
    return EmulatedPort(EmulatedBus(rig_of_four))


@pytest.fixture
def servos(port):
    return port.bus


@pytest.fixture
def bus(port):
    return Bus(port, 1_000_000)
