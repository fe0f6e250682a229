"""rustypot's controller of STS3215 servos, unchanged, on an emulated SO-101 arm."""

import math
import sys

import pytest

from hardware.emulator.process import start_emulator
from hardware.families.models import MODELS
from motiondeck_base.shipped import shipped_configs
from tests.hardware.emulator.test_stock_clients import insist, patient

IDS = [1, 2, 3, 4, 5, 6]


@pytest.fixture(scope="module")
def arm():
    rustypot = pytest.importorskip("rustypot")
    with start_emulator(shipped_configs() / "rigs" / "so101.toml") as emulator:
        servos = patient(lambda: rustypot.Sts3215PyController(emulator.port, 1_000_000, 0.5))
        yield servos
        servos.close()


pytestmark = pytest.mark.skipif(sys.version_info >= (3, 14), reason="rustypot has no wheels for this Python")


def test_it_finds_them_with_their_model(arm):
    assert all(patient(lambda id=id: arm.ping(id)) for id in IDS)
    assert patient(lambda: arm.sync_read_model(IDS)) == [777] * 6


def test_its_table_of_the_model_is_ours(arm):
    """An independent transcription: places, sizes and which registers can be written."""
    ours = {(row.address, row.length): row.access for row in MODELS["STS3215"].registers.values()}
    theirs = {(row.addr, row.size): str(row.access) for row in arm.registers()}
    assert theirs.keys() <= ours.keys()
    assert {place for place, access in theirs.items() if "Write" not in access} == {
        place for place in theirs if ours[place] == "R"
    }
    assert ours.keys() - theirs.keys() == {(2, 1), (64, 1)}  # byte order, registered instruction
    assert arm.models()["STS3215"] == MODELS["STS3215"].number


def test_it_moves_them_and_reads_where_they_are(arm):
    patient(lambda: arm.sync_write_torque_enable(IDS, [True] * 6))
    patient(lambda: arm.sync_write_goal_position(IDS, [0.5] * 6))
    reached = insist(
        lambda: patient(lambda: arm.sync_read_present_position(IDS)),
        lambda said: all(abs(place - 0.5) < 0.01 for place in said),
    )
    assert reached == pytest.approx([0.5] * 6, abs=0.01)
    patient(lambda: arm.write_torque_enable(6, False))
    assert patient(lambda: arm.read_torque_enable(6)) in ([False], False)


def test_it_writes_a_homing_offset_with_its_sign(arm):
    patient(lambda: arm.write_torque_enable(1, False))
    patient(lambda: arm.write_lock(1, False))
    before = patient(lambda: arm.read_present_position(1))
    patient(lambda: arm.write_homing_offset(1, -0.25))
    after = patient(lambda: arm.read_present_position(1))
    assert _one(after) - _one(before) == pytest.approx(0.25, abs=0.01)
    assert _one(patient(lambda: arm.read_homing_offset(1))) == pytest.approx(-0.25, abs=0.01)
    assert math.isfinite(_one(patient(lambda: arm.read_present_velocity(1))))


def _one(said):
    return said[0] if isinstance(said, list) else said
