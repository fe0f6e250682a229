"""The fault matrix: its relay passes and loses bytes as told, and its table says what was not as it must be."""

import contextlib
import os
import pty
import socket
import subprocess
import sys
import tty
from pathlib import Path

import pytest

from benchmarks.stop import bus_relay, fault_matrix, kills
from benchmarks.stop.command_runner import CommandRunner
from benchmarks.stop.fault_matrix import FAULTS, SOURCES, Trial
from benchmarks.stop.stop import with_table
from benchmarks.stop.surroundings import LossyNetwork
from waiting import PATIENCE, until

ROOT = Path(__file__).parents[2]


@pytest.fixture
def relayed(tmp_path):
    """A relay between two pseudo-terminals: our end of the servos', the relay's port, its process and its record."""
    servos, slave = pty.openpty()
    tty.setraw(slave)
    record = tmp_path / "bus.record"
    command = [sys.executable, "-c", "from benchmarks.stop.bus_relay import main; main()"]
    with subprocess.Popen(
        [*command, os.ttyname(slave), "1000000", str(record)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
        cwd=ROOT,
    ) as process:
        port = os.open(process.stdout.readline().strip(), os.O_RDWR | os.O_NOCTTY)
        yield servos, port, process, record
        process.stdin.close()
    for each in (servos, slave, port):
        os.close(each)


def ways(record):
    return {way: b"".join(data for _, one, data in bus_relay.entries(record) if one == way) for way in range(4)}


def test_the_relay_passes_every_byte_both_ways_and_records_it(relayed):
    servos, port, _, record = relayed
    sent = bytes(range(256))
    os.write(port, sent)
    arrived = b""
    while len(arrived) < len(sent):
        arrived += os.read(servos, 4096)
    os.write(servos, b"\x13\x11\r\n")
    assert arrived == sent
    assert os.read(port, 100) == b"\x13\x11\r\n"
    times = [now for now, _, _ in bus_relay.entries(record)]
    assert times == sorted(times)
    assert ways(record) == {0: sent, 1: b"\x13\x11\r\n", 2: b"", 3: b""}


def test_a_cut_bus_loses_what_comes_until_it_is_joined(relayed):
    servos, port, process, record = relayed

    def write_one_at_a_time(data, way):
        """Until one has gone this way: how soon the relay reads its orders is chance."""
        before = len(ways(record)[way])
        while len(ways(record)[way]) == before:
            known = sum(map(len, ways(record).values()))
            os.write(port, data)
            until(lambda: sum(map(len, ways(record).values())) == known + len(data), "the relay")  # noqa: B023

    process.stdin.write("cut\n")
    write_one_at_a_time(b"lost?", bus_relay.LOST)
    process.stdin.write("join\n")
    write_one_at_a_time(b"here?", bus_relay.TO_SERVOS)
    passed = ways(record)[bus_relay.TO_SERVOS]
    arrived = b""
    while len(arrived) < len(passed):
        arrived += os.read(servos, 4096)
    assert arrived == passed
    assert passed.endswith(b"here?")
    assert ways(record)[bus_relay.LOST].startswith(b"lost?")


def test_a_network_loses_about_as_many_datagrams_as_it_shall():
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deck,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client,
    ):
        deck.bind(("127.0.0.1", 0))
        deck.settimeout(PATIENCE)
        network = LossyNetwork(deck.getsockname()[1], 0.2, seed=3)
        arrived = 0
        for _ in range(200):
            client.sendto(b"x", ("127.0.0.1", network.port))
        with contextlib.suppress(TimeoutError):
            while deck.recv(10) == b"x":
                arrived += 1
                deck.settimeout(PATIENCE if arrived <= 130 else 0.3)
        network.close()
    assert 130 < arrived < 190


def test_command_lines_run_one_after_the_other_and_say_how_they_ended(tmp_path):
    tmp_path.chmod(0o700)
    runner = CommandRunner(os.environ | {"XDG_RUNTIME_DIR": str(tmp_path), "TMPDIR": str(tmp_path)}, ROOT)
    runner.start("send", "help")
    assert runner.finish(60.0)[0] == 0
    runner.start("send", "estop", "--command-port", "7000")
    code, said = runner.finish(60.0)
    assert code == 1
    assert "no deck is running" in said
    runner.close()


def trial(source="door", fault="nothing", **found):
    good = {"worst": 0.9, "braking_after": 0.02, "still_after": 0.06, "shafts_stand": True}
    return Trial(source, fault, at=0.0, broken_at=0.0, end=1.0, **good | found)


def test_a_cell_tells_median_and_worst_and_what_is_wrong():
    assert fault_matrix.cell([]) == ""
    assert fault_matrix.cell([trial(), trial(braking_after=0.04), trial(braking_after=0.01)]) == "20, 40"
    assert fault_matrix.cell([trial(), trial(worst=2.75)]) == "**20, 20: 2.8 of a limit**"
    assert "no rest" in fault_matrix.cell([trial(still_after=None)])
    assert "moves again" in fault_matrix.cell([trial(moved=0.1)])
    assert fault_matrix.cell([trial(moved=0.1, goes_home=True)]) == "20, 20"
    assert "shafts move" in fault_matrix.cell([trial(shafts_stand=False)])


def test_a_trial_is_good_at_rest_within_the_limits_and_in_time():
    assert trial().at_rest
    assert not trial(worst=1.1).at_rest
    assert not trial(moved=0.1).at_rest
    assert not trial(still_after=None).at_rest
    assert not trial(shafts_stand=False).at_rest
    assert not trial(braking_after=0.16).in_time
    assert trial("network", "loss", braking_after=0.9).in_time


def test_the_table_has_a_row_for_each_fault_and_a_column_for_each_source_and_replaces_the_old_one():
    trials = [trial(source, fault) for source in SOURCES for fault in FAULTS]
    table = fault_matrix.table(trials)
    assert len(table.splitlines()) == 2 + len(FAULTS)
    assert {line.count("|") for line in table.splitlines()} == {2 + len(SOURCES)}
    page = "before\n<!-- stops, by benchmarks stop -->\nold\n<!-- end of stops -->\nafter\n"
    assert with_table(page, table) == page.replace("old\n", f"\n{table}\n\n")


def test_every_cell_is_tried_once_a_repetition():
    tried = [(source, stage.fault) for stage in fault_matrix.stages() for source in stage.sources]
    assert len(tried) == len(set(tried))
    same = {("death", "killed"), ("raising", "raising")}
    assert set(tried) == {(source, fault) for source in SOURCES for fault in FAULTS} - same


def test_a_plan_of_strikes_has_as_many_as_asked_for_and_is_the_same_for_a_seed():
    runs = kills.plan(200, 3)
    assert sum((end == "kill") + len(pauses) for _, end, pauses in runs) == 200
    assert runs == kills.plan(200, 3) != kills.plan(200, 4)
    assert {motion for motion, _, _ in runs} == set(kills.MOTIONS)
