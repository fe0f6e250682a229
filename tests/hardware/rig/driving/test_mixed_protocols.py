"""One bus with servos of both protocols: AX, RX and MX of Protocol 1.0, an XL-320, a P series and an XM430.

All models and faults:  python -m benchmarks health_table --old
"""

import msgspec
import numpy as np
import pytest

from benchmarks.rig.health_table import OLD_MODELS, mixed_rig, run
from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.families.models import MODELS
from hardware.rig.counters import RigFaults
from hardware.rig.driving.readings import Measurements, Readings
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.scale import RigScale
from hardware.rig.state_block import motion
from hardware.rig.supervision.rig import Rig
from hardware.rig.supervision.servo_states import CONDITIONS
from hardware.rig.switching.audit import audit
from hardware.tools.doctor import examine, fix_settings
from hardware.tools.monitor import observe
from hardware.tools.scan import scan, set_up

COUNT = len(OLD_MODELS)
TICK = 0.01


@pytest.fixture
def config():
    return mixed_rig(models=OLD_MODELS)


@pytest.fixture
def port(config):
    return EmulatedPort(EmulatedBus(config), paced=True)


@pytest.fixture
def bus(config, port):
    bus = Bus(port, config.baud)
    bus.families = config.families
    return bus


def started(models):
    """The readings of a rig that is switched on; only the motion of its servos is read all at once."""
    config, count = mixed_rig(models=models), len(models)
    readings = Readings(config, range(count), RigScale(config), Measurements(count), RigFaults.none(count))
    readings.start(range(count), np.zeros(count), [motion(joint.table) for joint in config.joints], 0.0)
    return readings


@pytest.mark.parametrize("models", [("MX-28(1.0)", "MX-64(1.0)", "XM430-W350"), OLD_MODELS])
def test_a_silent_servo_is_asked_again_whichever_turn_it_has(models):
    """Requests go in turns; asked in every thirtieth of them, a servo whose turn is the other one never was again."""
    readings, everybody = started(models), range(len(models))
    for silent in everybody:
        readings.measured.missed_in_a_row[:] = 0
        readings.measured.missed_in_a_row[silent] = 5
        asked = []
        for request in range(300):
            question = readings.next_request()
            readings.requested(question)
            if silent in question.joints:
                asked.append(request)
        assert len(asked) >= 5
        assert np.diff(asked).max() <= 60


@pytest.mark.parametrize(
    "models",
    [
        ("XL-320", "PH54-200-S500", "PH54-100-S500", "MX-28(1.0)"),
        ("PH54-200-S500", "PH54-100-S500", "PM54-060-S250", "XL-320", "AX-12A", "MX-64(1.0)"),
        OLD_MODELS,
    ],
)
def test_the_health_of_every_servo_is_read_whichever_turn_it_has(models):
    """Two turns and two servos whose health is read in turn kept step: no request read the health of one of them."""
    readings, everybody = started(models), range(len(models))
    healthy = set()
    for _ in range(100):
        question = readings.next_request()
        readings.requested(question)
        states = zip(question.joints.tolist(), question.states, strict=True)
        healthy |= {index for index, state in states if state.healthy}
    assert healthy == set(everybody)


def supervised(config, port):
    return Rig(config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)


def play(rig, port, target, seconds):
    """Runs the loop; the largest speed of each shaft, rad/s."""
    before, fastest = shafts(rig.config, port), np.zeros(COUNT)
    for _ in range(round(seconds / TICK)):
        rig.collect_state()
        rig.write(np.full(COUNT, target))
        port.elapse(TICK)
        now = shafts(rig.config, port)
        fastest, before = np.maximum(fastest, np.abs(now - before) / TICK), now
    return fastest


def shafts(config, port):
    pairs = zip(config.joints, port.bus.devices, strict=True)
    return np.array([(device.bank.shaft[device.row] - j.zero) / j.pulses_per_radian for j, device in pairs])


def test_all_follow_within_their_speed_and_report_their_health(config, port):
    rig = supervised(config, port)
    fastest = play(rig, port, 0.8, 1.5)
    assert shafts(config, port) == pytest.approx(np.full(COUNT, 0.8), abs=0.01)
    assert rig.positions == pytest.approx(np.full(COUNT, 0.8), abs=0.01)
    assert (fastest < 1.1 * 2.0 + 0.1).all()
    assert (fastest > 1.5).all()
    assert rig.temperatures == pytest.approx(np.full(COUNT, 32.0), abs=1.0)
    assert rig.voltages.tolist() == [12.0, 18.5, 12.0, 12.0, 7.4, 12.0]
    assert (rig.recoveries, rig.faults.total, list(rig.incidents)) == (0, 0, [])
    assert rig.close() == []
    assert not any(device.torque for device in port.bus.devices)


def test_speed_and_load_have_the_joints_direction_in_every_model(config, port):
    joints = tuple(msgspec.structs.replace(joint, direction=-1) for joint in config.joints)
    rig = supervised(msgspec.structs.replace(config, joints=joints), port)
    play(rig, port, 1.2, 0.4)
    assert rig.velocities == pytest.approx(np.full(COUNT, 2.0), abs=0.2)
    play(rig, port, -1.2, 0.9)
    assert rig.velocities == pytest.approx(np.full(COUNT, -2.0), abs=0.2)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("model", "fault"), [("AX-12A", "overload"), ("MX-28(1.0)", "overheat"), ("XL-320", "overload")]
)
def test_a_fault_of_an_old_model_is_named_within_a_second(model, fault):
    found = run(model, fault, models=OLD_MODELS)
    assert 0.0 <= found.after <= 1.0
    assert model in found.end


def test_a_dead_servo_of_one_protocol_costs_the_others_nothing(config, port):
    rig = supervised(msgspec.structs.replace(config, on_loss="go on"), port)
    play(rig, port, 0.2, 0.5)
    port.bus[1].dead = True
    play(rig, port, 0.8, 2.3)
    assert np.delete(shafts(config, port), 0) == pytest.approx(np.full(COUNT - 1, 0.8), abs=0.01)
    assert [CONDITIONS[place] == "is lost" for place in rig.states.conditions] == [True] + [False] * (COUNT - 1)


LEFT_BEHIND = {
    (3, "multi_turn_offset"): (500, "its zero is elsewhere"),
    (3, "resolution_divider"): (2, "its counts mean other angles"),
    (1, "shutdown"): (0, "it does not protect itself"),
    (5, "shutdown"): (0, "shutdown is 0, the rig needs 3"),
    (2, "temperature_limit"): (120, "it gets too hot"),
}


@pytest.mark.thorough
@pytest.mark.parametrize(("id", "register"), LEFT_BEHIND)
def test_what_could_move_an_old_servo_wrongly_is_refused_named_and_fixed_on_request(config, port, bus, id, register):
    port.bus[id][register], said = LEFT_BEHIND[id, register]
    with pytest.raises(RigError, match=said):
        supervised(config, port)
    assert any(said in problem for problem in examine(config, bus).problems)
    assert fix_settings(config, bus).refused == []
    assert play(supervised(config, port), port, 1.2, 1.0).max() < 1.1 * 2.0 + 0.1


@pytest.mark.thorough
@pytest.mark.parametrize(
    "left",
    [
        {(1, "status_return_level"): 0, (3, "profile_acceleration"): 3, (4, "torque_control_mode"): 1},
        {(1, "torque_limit"): 0, (1, "min_position_limit"): 0, (1, "cw_compliance_slope"): 2, (5, "control_mode"): 1},
        {(1, "max_torque"): 700, (1, "max_position_limit"): 0, (1, "cw_compliance_slope"): 254},
        {(1, "profile_velocity"): 0},
    ],
)
def test_what_may_be_set_is_set_at_switch_on(config, port, bus, left):
    for (id, register), value in left.items():
        port.bus[id][register] = value
    rig = supervised(config, port)
    kept = {register for (id, register), value in left.items() if port.bus[id][register] == value}
    assert kept <= {"max_torque", "cw_compliance_slope"}  # the most torque and the gain are the servo's own
    assert play(rig, port, 1.2, 1.2).max() < 1.1 * 2.0 + 0.1
    assert shafts(config, port) == pytest.approx(np.full(COUNT, 1.2), abs=0.02)
    assert not [difference for difference in audit(config, bus) if difference.when == "switch-on"]


@pytest.mark.parametrize("limits", [(0, 0), (4095, 4095)])
def test_the_doctor_names_an_old_servo_that_would_turn_without_an_end(config, port, bus, limits):
    assert not any("without an end" in note for note in examine(config, bus).notes)
    port.bus[3]["min_position_limit"], port.bus[3]["max_position_limit"] = limits
    assert any("(id 3) is set to turn without an end" in note for note in examine(config, bus).notes)


@pytest.mark.parametrize("level", [0, 1])
def test_the_doctor_names_and_mends_an_old_servo_that_does_not_answer_all(config, port, bus, level):
    port.bus[1]["status_return_level"] = level
    report = examine(config, bus)
    assert report.missing == []
    said = [*report.problems, *report.notes]
    assert level == 1 or any("AX-12A (id 1) answers a ping but no read" in problem for problem in said)
    assert fix_settings(config, bus).refused == []
    assert port.bus[1]["status_return_level"] == 2
    assert not any("answers a ping" in problem for problem in examine(config, bus).problems)


@pytest.mark.parametrize("model", ["AX-12A", "MX-64(1.0)", "XL-320", "XM430-W350"])
@pytest.mark.parametrize("level", [0, 1])
def test_a_lone_servo_that_does_not_answer_all_is_set_up(model, level):
    port = EmulatedPort(EmulatedBus(mixed_rig(models=[model])), paced=True)
    port.bus[1]["status_return_level"] = level

    def open_bus(baud):
        port.bus.baud = baud
        return Bus(port, baud)

    before, after = set_up(open_bus, 7, 1_000_000)
    assert (before.identity.id, before.identity.model) == (1, model)
    assert (after.id, after.model) == (7, model)
    assert port.bus[7]["status_return_level"] == 2


def test_eeprom_is_written_only_where_it_is_wrong(config, port):
    supervised(config, port).close()
    before = [bytes(device.bank.memory) for device in port.bus.devices]
    port.sent.clear()
    rig = supervised(config, port)
    levels = [data for data in port.sent if data[4:6] in (b"\x03\x10", b"\x83\x10")]
    rig.close()
    assert levels == []
    assert [len(memory) for memory in before] == [len(device.bank.memory) for device in port.bus.devices]


def test_shut_down_servos_are_named_and_not_switched_on(config, port):
    port.bus[1].fail(32)
    port.bus[5].fail(4)
    with pytest.raises(RigError, match=r"AX-12A \(id 1: overload\); XL-320 \(id 5: overheated\)"):
        supervised(config, port)
    assert not any(device.torque for device in port.bus.devices)


def test_a_killed_program_leaves_servos_without_a_watchdog_at_their_last_goal(config, port):
    rig = supervised(config, port)
    play(rig, port, 0.8, 0.3)
    goals = rig.goals.copy()
    port.elapse(2.0)
    assert shafts(config, port)[:5] == pytest.approx(goals[:5], abs=0.01)
    assert (np.abs(goals) < 0.65).all()


def test_the_doctor_and_the_monitor_know_every_model(config, port, bus):
    report = examine(config, bus)
    assert [servo.model for servo in report.servos] == list(OLD_MODELS)
    assert [round(servo.position, 2) for servo in report.servos] == [0.0] * COUNT
    port.bus[1].fail(32)
    rows, _ = next(observe(config, bus, share=0.0))
    assert [row["heard"] for row in rows] == [True] * COUNT
    assert [row["errors"] for row in rows] == ["overload"] + [""] * (COUNT - 1)


def test_a_scan_finds_the_servos_of_both_protocols(config, port):
    for device, baud in ((port.bus[1], 34), (port.bus[6], 1)):
        device["baud_rate"] = baud

    def open_bus(baud):
        port.bus.baud = baud
        return Bus(port, baud)

    found = scan(open_bus)
    seen = {(one.identity.id, one.identity.model, one.identity.family, one.baud) for one in found}
    family = {id: MODELS[model].family for id, model in enumerate(OLD_MODELS, 1)}
    bauds = dict.fromkeys(range(1, COUNT + 1), 1_000_000) | {1: 57600, 6: 57600}
    assert seen == {(id, model, family[id], bauds[id]) for id, model in enumerate(OLD_MODELS, 1)}


def test_an_ax_servo_from_the_box_gets_its_id_and_baud_rate():
    joint = RigJoint("leg", 1, "AX-12A", 1, 512, -1.0, 1.0, 2.0)
    port = EmulatedPort(EmulatedBus(RigConfig("emulated", 57600, 100.0, (joint,))))

    def open_bus(baud):
        port.bus.baud = baud
        return Bus(port, baud)

    before, after = set_up(open_bus, 9, 1_000_000)
    assert (before.identity.id, before.baud, after.id, after.model, after.family.name) == (
        1,
        57600,
        9,
        "AX-12A",
        "dynamixel1",
    )
    with pytest.raises(RigError, match="model AX-12A cannot do 4000000 baud"):
        set_up(open_bus, 9, 4_000_000)
