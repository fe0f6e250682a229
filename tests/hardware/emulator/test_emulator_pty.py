"""A real pseudo-terminal: the maker's own client, our bus, and processes that come and go."""

import os
import subprocess
import sys
import threading
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import dynamixel_sdk as sdk
import msgspec
import numpy as np
import pytest

from hardware.bus.port import SerialPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.process import start_emulator
from hardware.emulator.pty_server import PtyServer, pump, serve
from hardware.errors import RigError, SerialPortError
from hardware.families.dynamixel2 import frames as instructions
from hardware.rig.rig_file import load_rig
from hardware.rig.supervision.rig import Rig
from motiondeck_base.errors import FileFormatError
from waiting import until

OK = sdk.COMM_SUCCESS
GOAL, PRESENT, TORQUE, LIMIT = 116, 132, 64, 48
IDS = range(1, 21)


@pytest.fixture
def packets():
    return sdk.PacketHandler(2.0)


@pytest.fixture
def served(rig_of_four):
    """An emulated rig on a pty, served by a thread, so that a test reaches the servos behind it."""
    server = PtyServer(EmulatedBus(rig_of_four))
    done = threading.Event()

    def serve():
        while not done.is_set():
            pump([server])

    thread = threading.Thread(target=serve)
    thread.start()
    yield server
    done.set()
    thread.join()
    server.close()


def insist(call):
    """Repeats a call of the maker's client, which gives up after 34 ms: too soon for a busy machine.

    The client's answers end in (result, error number); that of a group is the result alone.
    """
    answer = call()
    for _ in range(200):
        if answer[max(0, len(answer) - 2)] == OK:
            break
        time.sleep(0.1)  # an answer still on its way would be taken for that of the next call
        answer = call()
    return answer


def test_the_makers_client_pings_every_servo(client, packets):
    for id in IDS:
        assert insist(lambda id=id: packets.ping(client, id)) == (1020, OK, 0)


def test_the_makers_client_finds_all_by_broadcast(client, packets):
    found = {id: [1020, 46] for id in IDS}
    until(lambda: packets.broadcastPing(client) == (found, OK), "an answer of all")


def test_the_makers_client_writes_and_reads_back(client, packets):
    assert insist(lambda: packets.write4ByteTxRx(client, 7, GOAL, 2300)) == (OK, 0)
    assert insist(lambda: packets.read4ByteTxRx(client, 7, GOAL)) == (2300, OK, 0)


def test_the_makers_client_is_refused_the_eeprom_while_torque_is_on(client, packets):
    assert insist(lambda: packets.write1ByteTxRx(client, 5, TORQUE, 1)) == (OK, 0)
    assert insist(lambda: packets.write4ByteTxRx(client, 5, LIMIT, 3000)) == (OK, 7)
    assert insist(lambda: packets.write1ByteTxRx(client, 5, TORQUE, 0)) == (OK, 0)
    assert insist(lambda: packets.write4ByteTxRx(client, 5, LIMIT, 3000)) == (OK, 0)


@pytest.mark.parametrize("read", ["txRxPacket", "fastSyncRead"])
def test_the_makers_client_writes_and_reads_groups(client, packets, read):
    writer = sdk.GroupSyncWrite(client, packets, GOAL, 4)
    for id in IDS:
        assert writer.addParam(id, list((2000 + id).to_bytes(4, "little")))
    assert writer.txPacket() == OK
    reader = sdk.GroupSyncRead(client, packets, GOAL, 4)
    for id in IDS:
        assert reader.addParam(id)
    assert insist(lambda: (getattr(reader, read)(),)) == (OK,)
    assert {id: reader.getData(id, GOAL, 4) for id in IDS} == {id: 2000 + id for id in IDS}


def test_the_makers_client_moves_a_servo(client, packets):
    assert insist(lambda: packets.write4ByteTxRx(client, 9, GOAL, 2048)) == (OK, 0)
    assert insist(lambda: packets.write1ByteTxRx(client, 9, TORQUE, 1)) == (OK, 0)
    assert insist(lambda: packets.write4ByteTxRx(client, 9, GOAL, 2400)) == (OK, 0)
    until(lambda: abs(packets.read4ByteTxRx(client, 9, PRESENT)[0] - 2400) <= 1, "the servo's arrival")
    assert insist(lambda: packets.write1ByteTxRx(client, 9, TORQUE, 0)) == (OK, 0)


def test_one_client_after_the_other_is_served(emulator):
    for _ in range(3):
        bus = Bus.open(emulator.port, 4_000_000)
        assert until(lambda bus=bus: bus.ping(20), "an answer").model == "XM430-W350"
        bus.close()


def test_a_port_in_use_is_refused(emulator):
    bus = Bus.open(emulator.port, 1_000_000)
    with pytest.raises(SerialPortError, match="another program is using it"):
        Bus.open(emulator.port, 1_000_000)
    bus.close()


class PumpedPort(SerialPort):
    """A port whose other end is served while it waits, so that no time passes but the test's own."""

    def __init__(self, server, clock, baud):
        super().__init__(server.port, baud)
        self._server, self._clock = server, clock

    def wait(self, seconds):
        came = super().wait(0.0)
        while not came and seconds > 0.0:
            pump([self._server])
            came, seconds = super().wait(0.0), seconds - 0.02
        return came

    def now(self):
        return self._clock.time


def test_the_rig_plays_over_the_wire(servo20_file, monkeypatch):
    config = load_rig(servo20_file)
    clock = SimpleNamespace(time=0.0)
    monkeypatch.setattr("hardware.emulator.pty_server.time", SimpleNamespace(monotonic=lambda: clock.time))
    server = PtyServer(EmulatedBus(config), paced=False)
    port = PumpedPort(server, clock, config.baud)
    targets = np.linspace(-0.5, 0.5, 20)
    with closing(Rig(config, lambda part: Bus(port, part.baud))) as rig:
        for _ in range(200):
            rig.collect_state()
            rig.write(targets)
            port.wait(1.0)
            clock.time += 0.01
        assert rig.positions == pytest.approx(targets, abs=3e-3)
        assert (rig.recoveries, rig.faults.total) == (0, 0)
        assert rig.close() == []
    port.close()
    server.close()


def test_a_killed_client_leaves_a_rig_that_stops(served):
    """The client sets off for a goal 11 s away and is killed on the way; the servos stop by themselves."""
    command = [sys.executable, "-c", _RUNAWAY, served.port]

    def under_way():
        """The client, once the servos have got a core to answer it in."""
        client = subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True)
        if client.stdout.readline() == "under way\n":
            return client
        client.communicate()
        return None

    client = until(under_way, "a client under way")
    servo = served._bus[1]
    until(lambda: any(device.moving for device in served._bus.devices), "the start")
    client.kill()
    client.wait()
    client.stdout.close()
    until(lambda: servo["bus_watchdog"] == -1 and servo["present_velocity"] == 0, "the stop")
    stopped = servo["present_position"]
    assert stopped < 3900
    time.sleep(0.2)
    assert abs(servo["present_position"] - stopped) <= 2


_RUNAWAY = """
import sys, time
from hardware.bus.servo_bus import Bus
bus = Bus.open(sys.argv[1], 1_000_000)
bus.write(1, 112, (12).to_bytes(4, "little"))
bus.write(1, 64, b"\\1")
bus.write(1, 98, b"\\x0a")
bus.write(1, 116, (4095).to_bytes(4, "little"))
print("under way", flush=True)
while True:
    bus.ping(2)
    time.sleep(0.01)
"""


def test_a_dead_servo_on_the_wire_costs_one_servo(served):
    served._bus[2].dead = True
    bus = Bus.open(served.port, 1_000_000)
    blocks = tuple((id, PRESENT, 4) for id in (1, 2, 3, 4))
    for fast in (False, True):
        assert sorted(until(lambda fast=fast: bus.bulk_read(blocks, fast), "an answer")) == [1, 3, 4]
    bus.close()


def test_pulling_the_plug_is_one_clear_error(rig_of_four):
    server = PtyServer(EmulatedBus(rig_of_four))
    bus = Bus.open(server.port, 1_000_000)
    server.close()
    server.close()
    with pytest.raises(SerialPortError, match="is gone"):
        bus.ping(1)
    with pytest.raises(SerialPortError, match="is gone"):
        bus.sync_write(116, 4, bytes(5))
    bus.close()


def test_nobody_reading_does_not_block_the_emulator(served):
    """A pseudo-terminal takes 17 kB that nobody reads."""
    bus = Bus.open(served.port, 1_000_000)
    question = instructions.bulk_read([(id, 0, 140) for id in (1, 2, 3, 4)])
    for _ in range(60):
        until(lambda: bus.port.send(question), "taking a question")
    bus.sync_write(65, 1, b"\1\1")
    until(lambda: served._bus[1]["led"], "the LED")
    until(lambda: bus.ping(1), "an answer, behind all that was not read")
    bus.close()


def test_the_emulator_serves_for_as_long_as_it_is_wanted_whoever_its_parent_is(rig_of_four, monkeypatch):
    parents, turns, ports = iter(range(9)), iter([True] * 3 + [False]), []
    monkeypatch.setattr(os, "getppid", lambda: next(parents))
    seen = []
    serve(rig_of_four, ports.append, between=seen.append, goes_on=lambda: next(turns))
    assert (len(seen), len(ports)) == (3, 1)
    assert not Path(ports[0]).exists()


def test_the_emulator_dies_with_its_parent(servo20_file):
    starter = (
        "import sys\n"
        "from hardware.emulator.process import start_emulator\n"
        "emulator = start_emulator(sys.argv[1])\n"
        "print(emulator.port, flush=True)\n"
        "import os, signal; os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    parent = subprocess.run([sys.executable, "-c", starter, str(servo20_file)], capture_output=True, text=True)
    port = parent.stdout.strip()
    assert port.startswith("/dev/")

    def gone():
        try:
            bus = Bus.open(port, 1_000_000)
        except SerialPortError:
            return True
        try:
            return bus.ping(1) is None
        except SerialPortError:
            return True
        finally:
            bus.close()

    until(gone, "the emulator's end")


def test_stopping_may_be_done_twice(servo20_file):
    emulator = start_emulator(servo20_file)
    emulator.stop()
    emulator.stop()
    with pytest.raises(SerialPortError):
        Bus.open(emulator.port, 1_000_000).ping(1)


def test_a_wrong_rig_file_is_told_before_anything_starts(tmp_path):
    with pytest.raises(FileFormatError, match="cannot be read"):
        start_emulator(tmp_path / "none.toml")


def test_the_emulators_process_says_what_is_wrong(tmp_path):
    run = subprocess.run(
        [sys.executable, "-m", "hardware.emulator.process", "none.toml"], capture_output=True, text=True, cwd=tmp_path
    )
    assert run.returncode == 1
    assert run.stderr.startswith("motiondeck: none.toml: cannot be read")
    assert run.stdout == ""


class Hub:
    """Emulated servos whose adapter a test pulls and plugs in again, each time as another pseudo-terminal."""

    def __init__(self, config):
        self.bus = EmulatedBus(config)
        self.server = PtyServer(self.bus)
        self.over = threading.Event()
        self.lock = threading.Lock()
        self.thread = threading.Thread(target=self.serve)
        self.thread.start()

    def serve(self):
        while not self.over.is_set():
            with self.lock:
                pump([self.server])
            time.sleep(0)

    def replug(self):
        with self.lock:
            old, self.server = self.server, PtyServer(self.bus)
            old.close()

    def close(self):
        self.over.set()
        self.thread.join()
        self.server.close()


@pytest.fixture
def hub(rig_of_four):
    hub = Hub(rig_of_four)
    yield hub
    hub.close()


def test_after_a_failed_replug_torque_goes_off_over_the_new_port_and_nowhere_else(hub, rig_of_four, tmp_path):
    config = msgspec.structs.replace(rig_of_four, reconnect_s=0.1)
    buses = []

    def open_bus(part):
        buses.append(Bus.open(hub.server.port, part.baud))
        return buses[-1]

    rig = Rig(config, open_bus)
    first = buses[0].port
    assert isinstance(first, SerialPort)
    number = first._fd
    hub.bus[2].dead = True
    hub.replug()

    def stopped():
        try:
            rig.write(np.zeros(4))
        except RigError:
            return True
        return False

    until(stopped, "the end of patience")
    assert [hub.bus[id]["torque_enable"] for id in (1, 3, 4)] == [1, 1, 1]
    with (tmp_path / "bystander").open("wb") as bystander:
        # Whoever opens a file now may be given the number that the old port had, unless something has it already.
        free = not Path(f"/proc/self/fd/{number}").exists()
        if free:
            os.dup2(bystander.fileno(), number)
        assert rig.close() == ["joint_2"]
        if free:
            os.close(number)
    assert [hub.bus[id]["torque_enable"] for id in (1, 3, 4)] == [0, 0, 0]
    assert (tmp_path / "bystander").read_bytes() == b""
    for use in (lambda: first.send(b"\0"), first.receive, lambda: first.wait(0.0)):
        with pytest.raises(SerialPortError, match="is gone"):
            use()


def test_closing_while_it_mends_leaves_no_torque_on(hub, rig_of_four):
    """The servos have lost torque and power, so mending means switching on: it must not, once the rig is closed."""
    rig = Rig(rig_of_four, lambda part: Bus.open(hub.server.port, part.baud))
    for id in (1, 2, 3, 4):
        hub.bus[id]["torque_enable"] = 0
    hub.replug()
    until(lambda: rig.write(np.zeros(4)) or rig.faults.unsent.any(), "the start of the recovery")
    assert rig.close() == []
    assert not any(device["torque_enable"] for device in hub.bus.devices)
    assert not any(thread.name == "rig-recovery" for thread in threading.enumerate())
