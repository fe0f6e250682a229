"""Faults on purpose: how they are said, and what they do; and a pseudo-terminal that is pulled and comes back."""

import subprocess
import sys
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.simulated_time import EmulatedPort
from command_line import invoked
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import KINDS, Fault, FaultPlan, parse_fault
from hardware.emulator.pty_server import PtyServer, pump
from hardware.errors import SerialPortError
from hardware.families.models import MODELS
from motiondeck_base.errors import MotiondeckError
from waiting import until


def port_with(config, *faults, seed=0, paced=False):
    return EmulatedPort(EmulatedBus(config), paced, FaultPlan([parse_fault(fault) for fault in faults], seed))


def test_a_fault_is_said_in_one_word_and_a_few_numbers():
    assert parse_fault("dead:id=3,at=2,for=1") == Fault("dead", 3, 2.0, 1.0)
    assert parse_fault("drop:chance=0.1") == Fault("drop", chance=0.1)
    assert parse_fault("latency:value=16").value == 16.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("explode", "no fault 'explode'. There are: drop, "),
        ("drop:id", "'id' is not id=N"),
        ("drop:when=2", "'when=2' is not id=N"),
        ("jam", "jam:id=NUMBER"),
    ],
)
def test_a_wrong_fault_says_what_is_allowed(text, said):
    with pytest.raises(MotiondeckError, match=said.replace(".", r"\.")):
        parse_fault(text)


@given(st.text(max_size=30), st.sampled_from(list(KINDS)))
def test_any_words_are_a_fault_or_one_clear_error(text, kind):
    try:
        said = parse_fault(f"{kind}:{text}").kind
    except MotiondeckError as error:
        said = str(error)
    assert kind in said


def test_a_fault_of_a_servo_that_is_not_there_is_refused(rig_of_four):
    with pytest.raises(MotiondeckError, match=r"no id 9 on this rig \(ids: \[1, 2, 3, 4\]\)"):
        port_with(rig_of_four, "dead:id=9")


@pytest.mark.parametrize("kind", ["drop", "corrupt", "truncate"])
def test_answers_are_harmed_at_their_time_only(rig_of_four, kind):
    port = port_with(rig_of_four, f"{kind}:id=2,at=1,for=1")
    bus = Bus(port, 1_000_000, retries=0)
    assert bus.ping(2) is not None
    port.elapse(1.0)
    for _ in range(5):
        assert bus.ping(2) is None
        assert bus.ping(3) is not None
    port.elapse(1.0)
    assert bus.ping(2) is not None


def test_chance_is_the_seeds(rig_of_four):
    def heard(seed):
        bus = Bus(port_with(rig_of_four, "drop:chance=0.5", seed=seed), 1_000_000, retries=0)
        return [bus.ping(1) is not None for _ in range(40)]

    assert heard(1) == heard(1) != heard(2)
    assert 8 < sum(heard(1)) < 32


def test_a_delayed_answer_comes_late_and_usb_latency_comes_in_steps(rig_of_four):
    port = port_with(rig_of_four, "delay:value=5,for=1", "latency:value=16,at=1", paced=True)
    port.send(bytes.fromhex("fffffd00010300011 94e".replace(" ", "")))
    assert port.wait(0.1)
    assert 0.005 < port.now() < 0.006
    port.receive()
    port.elapse(1.1)
    port.send(bytes.fromhex("fffffd0001030001194e"))
    assert port.wait(0.1)
    assert port.now() == pytest.approx(1.12, abs=1e-9)


def test_a_duplicate_takes_another_ones_id_and_gives_it_back(rig_of_four):
    port = port_with(rig_of_four, "duplicate:id=2,value=1,at=1,for=1")
    bus = Bus(port, 1_000_000, retries=0)
    port.elapse(1.0)
    assert bus.ping(2) is None
    port.elapse(1.0)
    assert bus.ping(2) is not None


def test_servos_that_took_each_others_ids_at_the_same_time_get_their_own_back(rig_of_four):
    port = port_with(rig_of_four, "duplicate:id=1,at=1,for=1", "duplicate:id=2,at=1.5,for=1")
    bus = Bus(port, 1_000_000, retries=0)
    port.elapse(1.7)
    assert bus.ping(1) is None or bus.ping(2) is None
    port.elapse(1.0)
    assert [bus.ping(id) is not None for id in (1, 2, 3, 4)] == [True] * 4


@pytest.mark.parametrize(("fault", "other"), [("swap:id=2,at=1,for=1", None), ("swap:id=2,at=1,for=1,value=30", 30)])
def test_a_swapped_servo_is_another_model_without_torque_until_the_first_is_back(rig_of_four, fault, other):
    port = port_with(rig_of_four, fault)
    bus = Bus(port, 1_000_000)
    seen = []
    for end in (0.9, 1.9, 2.9):
        port.elapse(end - port.now())
        seen.append((bus.ping(2).model_number, port.bus[2]["torque_enable"], port.bus[3]["model_number"]))
        bus.write(2, 64, b"\x01")
    other = other or next(table.number for table in MODELS.values() if table.number == seen[1][0] != 1020)
    assert seen == [(1020, 0, 1020), (other, 0, 1020), (1020, 0, 1020)]


def test_of_two_faults_of_a_kind_the_longer_one_ends_it(rig_of_four):
    faults = "brownout:at=1,for=1,value=9", "brownout:at=1.5,for=1,value=9", "dead:id=1,at=1,for=1", "dead:id=1,at=1.5"
    port = port_with(rig_of_four, *faults)
    seen = []
    for end in (0.9, 1.8, 2.3, 2.7):
        port.elapse(end - port.now())
        seen.append((float(port.bus[1].bank.drive.supply[0]), port.bus[1].dead))
    assert seen == [(12.0, False), (9.0, True), (9.0, True), (12.0, True)]


def test_the_name_of_a_pulled_adapter_leads_nowhere(rig_of_four, tmp_path):
    """The number of its terminal is free, and the next terminal of the machine may be somebody else's."""
    link = tmp_path / "rig"
    server = PtyServer(EmulatedBus(rig_of_four), FaultPlan([parse_fault("unplug:at=0.01,for=100")]), link=link)
    assert link.is_symlink()
    deadline = time.monotonic() + 20.0
    while server.open and time.monotonic() < deadline:
        pump([server])
    assert not link.is_symlink()
    server.close()


def test_a_pulled_adapter_comes_back_under_its_name(rig_of_four, tmp_path):
    link = tmp_path / "rig"
    plan = FaultPlan([parse_fault("unplug:at=0.3,for=0.3")])
    server = PtyServer(EmulatedBus(rig_of_four), plan, link=link)
    done = threading.Event()

    def serve():
        while not done.is_set():
            pump([server])

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        bus = Bus.open(str(link), 1_000_000)
        deadline = time.monotonic() + 20.0

        def ping_for_ever():
            while time.monotonic() < deadline:
                bus.ping(1)

        with pytest.raises(SerialPortError, match="is gone"):
            ping_for_ever()
        bus.close()
        found = None
        while found is None and time.monotonic() < deadline:
            try:
                bus = Bus.open(str(link), 1_000_000)
                found = bus.ping(1)
                bus.close()
            except SerialPortError:
                time.sleep(0.02)
        assert found is not None
    finally:
        done.set()
        thread.join()
        server.close()
    assert not link.is_symlink()


def test_the_command_line_emulates_scans_and_stops(servo20_file, tmp_path):
    link = tmp_path / "rig"
    command = [sys.executable, "-m", "motiondeck.cli.main", "rig"]
    emulator = subprocess.Popen(
        [*command, "emulate", str(servo20_file), "--link", str(link)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert "20 servos at 4000000 baud" in emulator.stderr.readline()
        assert emulator.stdout.readline().strip() == str(link)

        def run(*words):
            return invoked("rig", *words, catch_exceptions=False)

        def answers(expected, *words):
            """Waits for what a command says of servos whose process may get no core in time."""

            def answered():
                try:
                    return expected(run(*words))
                except MotiondeckError as error:
                    if "no servo answers" not in str(error):
                        raise
                    return False

            until(answered, words[0])

        answers(lambda scanned: scanned.stdout.count("XM430-W350") == 20, "scan", link, "--baud", 4000000, "--json")
        file = (servo20_file, "--port", link)
        answers(lambda sick: sick.exit_code == 1 and "return_delay_time is 250" in sick.stdout, "doctor", *file)
        answers(lambda stopped: stopped.stdout == "torque off: 20 of 20 servos\n", "stop", *file)
        with pytest.raises(MotiondeckError, match="no fault 'explode'"):
            run("emulate", str(servo20_file), "--fault", "explode")
    finally:
        emulator.terminate()
        emulator.wait(20)
        emulator.stdout.close()
        emulator.stderr.close()
    assert emulator.returncode == 143
    assert not link.is_symlink()


def test_the_name_of_another_adapter_is_left_to_it(rig_of_four, tmp_path):
    link = tmp_path / "rig"
    link.symlink_to(tmp_path / "gone")  # of an emulator that was killed
    first = PtyServer(EmulatedBus(rig_of_four), link=link)
    place = link.readlink()
    with pytest.raises(SerialPortError, match=r"no link .*rig: File exists\. Remove it or name another\."):
        PtyServer(EmulatedBus(rig_of_four), link=link)
    assert link.readlink() == place
    first.close()
    assert not link.is_symlink()
