"""Other people's clients, unchanged, on emulated AX, MX (Protocol 1.0) and XL-320 servos beside an XM430 on one bus."""

import sys

import dynamixel_sdk as sdk
import pytest

from hardware.emulator.process import start_emulator
from tests.hardware.emulator.test_stock_clients import insist, patient

OK = sdk.COMM_SUCCESS
MODELS = {1: ("AX-12A", 512), 2: ("AX-12A", 512), 3: ("MX-28(1.0)", 2048), 4: ("MX-64(1.0)", 2048), 5: ("XL-320", 512)}
MODELS |= {6: ("XM430-W350", 2048), 7: ("MX-28(1.0)", 2048)}
GOAL, SPEED, TORQUE, POSITION = 30, 32, 24, 36


@pytest.fixture(scope="module")
def emulator(tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "old.toml"
    joints = "\n".join(
        f'[[joints]]\nname = "j{id}"\nid = {id}\nmodel = "{model}"\ndirection = 1\nzero = {zero}\n'
        "lower = -1.0\nupper = 1.0\nvelocity = 2.0"
        for id, (model, zero) in MODELS.items()
    )
    path.write_text(f'port = "none"\nbaud = 1_000_000\nrate_hz = 100.0\n{joints}\n')
    with start_emulator(path) as emulator:
        yield emulator


@pytest.fixture
def baud():
    return 1_000_000


def test_the_makers_sdk_finds_each_servo_with_its_own_protocol_only(client):
    for id, (number, protocol) in {1: (12, 1.0), 3: (29, 1.0), 4: (310, 1.0), 5: (350, 2.0), 6: (1020, 2.0)}.items():
        packets = sdk.PacketHandler(protocol)
        assert insist(lambda id=id, p=packets: p.ping(client, id), lambda said: said[1] == OK)[0] == number
        assert sdk.PacketHandler(3.0 - protocol).ping(client, id)[1] != OK


def test_sync_writes_and_bulk_reads_of_the_makers_sdk(client):
    packets = sdk.PacketHandler(1.0)
    writer = sdk.GroupSyncWrite(client, packets, GOAL, 4)
    for id in (1, 3):
        assert writer.addParam(id, [0, 2, 0, 1])
    assert writer.txPacket() == OK

    def bulk_read(*asked):
        """What each sends; the SDK's own class for it passes an argument too many under Protocol 1.0."""
        packets.bulkReadTx(  # pyright: ignore[reportCallIssue]
            client, [number for id, length in asked for number in (length, id, GOAL)], 3 * len(asked)
        )
        heard = [packets.readRx(client, id, length)[:2] for id, length in asked]
        client.is_using = False
        return [bytes(data) if result == OK else None for data, result in heard]

    wanted = b"\0\2\0\1"
    assert insist(lambda: bulk_read((3, 4), (4, 2)), lambda said: said[0] == wanted)[0] == wanted
    assert None not in insist(lambda: bulk_read((4, 2), (7, 8), (3, 4)), lambda said: None not in said)
    # An AX servo knows no bulk read, and keeps those behind it waiting.
    assert insist(lambda: bulk_read((3, 4), (1, 4), (4, 2)), lambda said: said[0] is not None)[1:] == [None, None]
    assert insist(lambda: packets.read4ByteTxRx(client, 1, GOAL), lambda said: said[1] == OK) == (
        512 | 256 << 16,
        OK,
        0,
    )


def test_an_ax_servo_moves_by_the_makers_sdk_and_refuses_as_its_manual_says(client):
    packets = sdk.PacketHandler(1.0)
    assert insist(lambda: packets.write1ByteTxRx(client, 2, TORQUE, 1), lambda said: said == (OK, 0)) == (OK, 0)
    assert insist(lambda: packets.write2ByteTxRx(client, 2, GOAL, 600), lambda said: said == (OK, 0)) == (OK, 0)
    reached = insist(lambda: packets.read2ByteTxRx(client, 2, POSITION), lambda said: abs(said[0] - 600) <= 1)
    assert abs(reached[0] - 600) <= 1
    # EEPROM is locked while torque is on; there is no reboot; an action needs something registered.
    _, error = insist(lambda: packets.write1ByteTxRx(client, 2, 5, 0), lambda said: said[0] == OK)
    assert error == 8
    assert insist(lambda: packets.regWriteTxRx(client, 2, 25, 1, [1]), lambda said: said == (OK, 0)) == (OK, 0)
    assert insist(lambda: packets.read1ByteTxRx(client, 2, 44), lambda said: said[1] == OK)[0] == 1
    packets.action(client, 254)
    assert insist(lambda: packets.read1ByteTxRx(client, 2, 25), lambda said: said[0] == 1)[0] == 1
    packets.write1ByteTxRx(client, 2, TORQUE, 0)
    packets.write2ByteTxRx(client, 2, 8, 700)
    assert insist(lambda: packets.write2ByteTxRx(client, 2, GOAL, 800), lambda said: said[0] == OK) == (OK, 2)


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="rustypot has no wheels for this Python")
@pytest.mark.parametrize(("controller", "id"), [("AxPyController", 1), ("MxPyController", 7), ("Xl320PyController", 5)])
def test_rustypot_reads_and_writes_old_servos(emulator, controller, id):
    import rustypot

    servos = patient(lambda: getattr(rustypot, controller)(emulator.port, 1_000_000, 0.5))
    assert patient(lambda: servos.ping(id))
    position = POSITION + (controller == "Xl320PyController")

    def read(address):
        data = patient(lambda: servos.read_raw_data(id, address, 2))
        return int.from_bytes(bytes(data), "little")

    patient(lambda: servos.sync_write_raw_data([id], GOAL, [[700 & 255, 700 >> 8]]))
    assert read(GOAL) == 700
    patient(lambda: servos.write_raw_data(id, TORQUE, [1]))
    patient(lambda: servos.write_raw_data(id, GOAL, [600 & 255, 600 >> 8]))
    assert abs(insist(lambda: read(position), lambda said: abs(said - 600) <= 2) - 600) <= 2
    patient(lambda: servos.write_raw_data(id, TORQUE, [0]))
    servos.close()
