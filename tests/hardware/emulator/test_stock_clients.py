"""Other people's clients, unchanged, on the emulator: dynamixel-sdk's group calls and easy SDK, and rustypot."""

import sys
import time

import dynamixel_sdk as sdk
import pytest

OK = sdk.COMM_SUCCESS
GOAL, PRESENT, TORQUE = 116, 132, 64
IDS = range(1, 21)


def insist(call, wanted=lambda result: result == OK):
    """Repeats what a client gives up too soon on a busy machine."""
    result = call()
    for _ in range(300):
        if wanted(result):
            break
        time.sleep(0.1)
        result = call()
    return result


def patient(call):
    """As `insist`, for clients that raise."""
    for _ in range(300):
        try:
            return call()
        except Exception:
            time.sleep(0.1)
    return call()


@pytest.mark.parametrize("read", ["txRxPacket", "fastBulkRead"])
def test_bulk_calls_of_the_makers_sdk(client, read):
    packets = sdk.PacketHandler(2.0)
    writer = sdk.GroupBulkWrite(client, packets)
    for id in IDS:
        data = list((1900 + id).to_bytes(4, "little")) if id % 2 else [id % 4 // 2]
        assert writer.addParam(id, GOAL if id % 2 else 65, len(data), data)
    assert writer.txPacket() == OK
    reader = sdk.GroupBulkRead(client, packets)
    if not hasattr(reader, read):
        pytest.skip(f"this dynamixel-sdk has no {read}")
    # The SDK's fast bulk read looks an ID up among all bytes of its request, where 4 is a length before it is an ID.
    ids = [id for id in IDS if id != 4]
    for id in ids:
        assert reader.addParam(id, GOAL if id % 2 else 65, 4 if id % 2 else 1)
    assert insist(getattr(reader, read)) == OK
    for id in ids:
        if id % 2:
            assert reader.getData(id, GOAL, 4) == 1900 + id
        else:
            assert reader.getData(id, 65, 1) == id % 4 // 2


def test_registered_writes_of_the_makers_sdk(client):
    packets = sdk.PacketHandler(2.0)
    assert insist(lambda: packets.regWriteTxRx(client, 4, 65, 1, [1])[0]) == OK
    assert insist(lambda: packets.read1ByteTxRx(client, 4, 69), lambda said: said == (1, OK, 0)) == (1, OK, 0)
    packets.action(client, 254)
    assert insist(lambda: packets.read1ByteTxRx(client, 4, 65), lambda said: said == (1, OK, 0)) == (1, OK, 0)


def test_reset_clear_and_reboot_of_the_makers_sdk(client):
    packets = sdk.Protocol2PacketHandler()
    assert insist(lambda: packets.clearMultiTurn(client, 6)[0]) == OK
    assert insist(lambda: packets.factoryReset(client, 6, 0x02)[0]) == OK
    time.sleep(0.3)
    assert insist(lambda: packets.reboot(client, 6)[0]) == OK
    time.sleep(0.3)
    assert insist(lambda: packets.ping(client, 6), lambda said: said == (1020, OK, 0)) == (1020, OK, 0)


def test_the_easy_sdk_finds_and_moves_a_servo(emulator):
    easy = pytest.importorskip("dynamixel_easy_sdk")
    connector = patient(lambda: easy.Connector(emulator.port, 4_000_000))
    motor = patient(lambda: connector.createMotor(8))
    patient(motor.enableTorque)
    patient(lambda: motor.setGoalPosition(2300))
    for _ in range(600):
        if abs(patient(motor.getPresentPosition) - 2300) <= 1:
            break
        time.sleep(0.05)
    assert abs(patient(motor.getPresentPosition) - 2300) <= 1
    patient(motor.disableTorque)
    connector._port_handler.closePort()


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="rustypot has no wheels for this Python")
@pytest.mark.parametrize("fast", [False, True])
def test_rustypot_reads_and_writes_groups_with_stuffing(emulator, fast):
    import rustypot

    servos = patient(lambda: rustypot.Xl330PyController(emulator.port, 4_000_000, 0.5))
    servos.set_fast_sync_read(fast)
    ids = [10, 11, 12]
    for id in ids:
        patient(lambda id=id: servos.write_raw_data(id, 11, [4]))
    # These four bytes hold a header's first three, so they must be stuffed on the way.
    values = [-131073, 1000, -131073]
    patient(lambda: servos.sync_write_raw_goal_position(ids, values))
    assert list(patient(lambda: servos.sync_read_raw_goal_position(ids))) == values
    assert patient(lambda: servos.ping(10))
    servos.close()
