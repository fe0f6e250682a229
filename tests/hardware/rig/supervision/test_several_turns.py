"""A geared waist goes through several turns of its horn, and is never driven in a turn that is only guessed."""

import json
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import FaultPlan, parse_fault
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.scale import RigScale
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.torque import hold_still
from hardware.rig.switching.turns import find_zeros
from hardware.rig.turn_file import Turn, TurnFile
from hardware.tools.calibration import Sweep
from hardware.tools.doctor import examine
from hardware.tools.loose_joints import keep_turns, loosen, positions, store_turns
from hardware.tools.teaching import watch_hands

HALF = np.pi / 3.0  # rad of the waist for half a turn of its horn


class Waist:
    """A waist behind a gear of 3, on a servo whose power can be cut."""

    def __init__(self, folder, model="XM540-W270", direction=1, current=0.0, faults=(), acceleration=0.0):
        zero = 0 if model.startswith("PH") else 2048
        self.joint = RigJoint(
            "waist", 1, model, direction, zero, -1.745, 1.745, 1.0, acceleration, gear=3.0, current=current
        )
        self.config = RigConfig("emulated", 1_000_000, 100.0, (self.joint,))
        self.file = TurnFile(folder / "turns.json")
        self.port = EmulatedPort(EmulatedBus(self.config), True, FaultPlan([parse_fault(one) for one in faults]))
        self.bus = Bus(self.port, 1_000_000)
        self.servo = self.port.bus.devices[0]
        if zero == 0:
            self.servo["shutdown"] = 62

    @property
    def angle(self):
        return self.joint.angle(float(self.servo.bank.shaft[0]))

    @angle.setter
    def angle(self, angle):
        self.servo.bank.shaft[0] = self.joint.pulses(angle)
        self.servo.bank.halt(0)
        self.port.elapse(0.01)

    def cut_power(self, angle=None):
        """Off and on again; meanwhile it is turned to an angle."""
        self.servo.reboot(self.port.now())
        if angle is not None:
            self.angle = angle
        self.servo.bank.to_one_turn(0)
        self.port.elapse(0.2)

    def open(self):
        self.rig = Rig(self.config, lambda part: self.bus, False, sleep=self.port.elapse, turns=lambda part: self.file)
        return self.rig

    def play(self, target, seconds):
        seen = []
        for tick in range(round(100 * seconds)):
            self.rig.collect_state()
            self.rig.write(np.array([target]))
            self.port.elapse(0.01)
            if tick % 10 == 0:
                self.rig.turn_keepers[0].look()
            seen.append(self.angle)
        return np.array(seen)

    @property
    def kept(self):
        return self.file.read()[1]


@pytest.fixture
def waist(tmp_path):
    waist = Waist(tmp_path)
    store_turns(waist.config, waist.bus, waist.file)
    return waist


@given(
    st.integers(-9000, 9000), st.sampled_from([1, -1]), st.floats(1.0, 8.0), st.integers(-60, 60), st.floats(-2.0, 2.0)
)
def test_an_angle_becomes_counts_and_is_the_angle_again(zero, direction, gear, turns, angle):
    joint = RigJoint("waist", 1, "XM540-W270", direction, zero, -4.0, 4.0, 1.0, gear=gear)
    scale = RigScale(RigConfig("p", 1_000_000, 100.0, (joint,)))
    scale.zero += turns * 4096
    counts = scale.pulses(np.array([angle]))
    assert scale.angles(counts) == pytest.approx([angle], abs=0.51 * 2 * np.pi / 4096 / gear)
    assert counts[0] - joint.pulses(angle) == pytest.approx(turns * 4096, abs=0.51)


@pytest.mark.parametrize("direction", [1, pytest.param(-1, marks=pytest.mark.thorough)])
@pytest.mark.parametrize(
    ("model", "current", "mode"),
    [
        ("XM540-W270", 1.0, 5),
        *(
            pytest.param(model, 0.0, 4, marks=pytest.mark.thorough)
            for model in ("XM540-W270", "XL430-W250", "PH54-200-S500")
        ),
    ],
)
def test_a_waist_goes_from_end_to_end(tmp_path, model, current, mode, direction):
    waist = Waist(tmp_path, model, direction, current)
    store_turns(waist.config, waist.bus, waist.file)
    waist.open()
    for target in (1.7, -1.7, 0.3):
        way = waist.play(target, 4.5)
        assert waist.angle == pytest.approx(target, abs=0.02)
        assert waist.rig.positions[0] == pytest.approx(waist.angle, abs=0.01)
        assert np.abs(np.diff(way)).max() < 0.013
    assert waist.servo["operating_mode"] == mode


def test_a_model_that_counts_no_turns_is_refused_in_one_line():
    with pytest.raises(
        ValueError, match=r"outside the servo's one turn \(0 to 4095\), and model 'MX-64\(1\.0\)' counts"
    ):
        RigJoint("waist", 1, "MX-64(1.0)", 1, 2048, -1.745, 1.745, 1.0, gear=3.0)


def test_without_a_stored_turn_nothing_moves(tmp_path):
    waist = Waist(tmp_path)
    with pytest.raises(
        RigError, match=r"waist \(id 1\) goes through several turns, and .* motiondeck rig turns RIG\.$"
    ):
        waist.open()
    assert (waist.servo["torque_enable"], waist.servo["operating_mode"]) == (0, 3)


@pytest.mark.parametrize("target", [1.6, 0.0, -1.6])
@pytest.mark.parametrize("sunk", [0.0, 0.1, -0.1])
def test_after_a_power_cut_it_is_where_it_was(waist, target, sunk):
    waist.open()
    waist.play(target, 3.0)
    waist.rig.close()
    waist.cut_power(waist.angle + sunk)
    rig = waist.open()
    assert rig.positions[0] == pytest.approx(waist.angle, abs=0.01)
    way = waist.play(-0.5 * target, 4.0)
    assert np.abs(np.diff(way)).max() < 0.013
    assert waist.angle == pytest.approx(-0.5 * target, abs=0.02)


@pytest.mark.parametrize("turned", [0.3, -0.8, 1.2])
def test_one_that_was_turned_while_its_power_was_off_is_refused(waist, turned):
    waist.open()
    waist.play(0.2, 1.0)
    waist.rig.close()
    waist.cut_power(waist.angle + turned * HALF)
    with pytest.raises(RigError, match="degrees from where it was left, and may stand in another turn"):
        waist.open()
    assert waist.servo["torque_enable"] == 0


@pytest.mark.parametrize("turned", [0.3, -1.0, 2.0])
def test_one_that_was_turned_by_hand_with_its_power_on_is_followed(waist, turned):
    waist.open()
    waist.play(-0.4, 1.0)
    waist.rig.close()
    waist.angle = waist.angle + turned * HALF
    assert waist.open().positions[0] == pytest.approx(waist.angle, abs=0.01)


def test_power_that_goes_while_it_moves_is_noticed(waist):
    waist.open()
    waist.play(1.6, 0.8)
    assert not waist.kept.stands
    waist.cut_power()
    with pytest.raises(RigError, match="was moving when its power went"):
        waist.open()


def test_a_program_that_is_killed_leaves_a_servo_that_has_counted_on(waist):
    waist.open()
    waist.play(1.6, 0.8)
    waist.port.elapse(1.0)
    assert waist.open().positions[0] == pytest.approx(waist.angle, abs=0.01)


def test_so_does_one_that_is_killed_at_once_after_a_power_cut(waist):
    waist.open()
    waist.play(1.6, 2.5)
    waist.rig.close()
    waist.cut_power()
    waist.open()
    assert waist.open().positions[0] == pytest.approx(waist.angle, abs=0.01)


def test_a_servo_that_restarts_while_it_plays_comes_back_in_its_turn(tmp_path):
    waist = Waist(tmp_path, faults=["reboot:id=1,at=3.0"])
    store_turns(waist.config, waist.bus, waist.file)
    waist.open()
    waist.play(1.6, 2.5)
    before = waist.kept
    at = waist.angle
    assert waist.play(1.6, 2.0) == pytest.approx(at, abs=0.15)
    assert waist.rig.recoveries == 1
    assert waist.kept.zero != before.zero
    waist.play(-1.2, 4.0)
    assert waist.angle == pytest.approx(-1.2, abs=0.02)


def test_one_without_power_for_a_while_comes_back_in_its_turn(tmp_path):
    """Its goal went on without it, and it was then looked for near the goal, half a turn away."""
    waist = Waist(tmp_path, faults=["brownout:at=2.0,for=1.2"])
    store_turns(waist.config, waist.bus, waist.file)
    waist.open()
    waist.play(-1.5, 1.9)
    seen = waist.play(0.5, 3.0)
    assert waist.rig.recoveries == 1
    assert seen.min() > -1.6
    assert seen[-1] > seen[-50] + 0.1


@pytest.mark.parametrize("fault", ["reboot:id=1,at=1.0", "brownout:at=1.0,for=0.4"])
def test_one_whose_power_goes_far_behind_its_goal_comes_back_in_its_turn(tmp_path, fault):
    """It was looked for near its goal alone, which a joint that gathers speed slowly is far behind."""
    waist = Waist(tmp_path, faults=[fault], acceleration=0.6)
    store_turns(waist.config, waist.bus, waist.file)
    waist.open()
    waist.play(-1.5, 0.95)
    at, ahead = waist.angle, abs(waist.rig.goals[0] - waist.angle)
    assert 0.3 < ahead / (2.0 * HALF) < 0.4
    assert np.abs(waist.play(-1.5, 1.5) - at).max() < 0.5
    assert waist.rig.recoveries == 1
    assert waist.rig.positions[0] == pytest.approx(waist.angle, abs=0.01)


def test_the_goal_of_one_that_is_not_read_stays(waist):
    """While other servos were waited for it counted as heard, and its goal went on out of its turn."""
    waist.open()
    waist.play(1.6, 0.5)
    at = waist.rig.goals[0]
    for _ in range(100):
        waist.rig.write(np.array([1.6]))
        waist.port.elapse(0.01)
    assert 0.05 < waist.rig.goals[0] - at < 0.2


def test_a_servo_without_torque_is_not_seen(waist):
    """After a restart it counts from another zero."""
    rig = waist.open()
    waist.play(0.3, 1.0)
    (port,) = rig._all_ports()
    rig.switch_off(0)
    waist.play(0.3, 0.2)
    waist.angle = 1.0
    waist.play(0.3, 0.1)
    assert rig.positions[0] == pytest.approx(1.0, abs=0.01)
    assert port.believed[0, 0] == pytest.approx(0.3, abs=0.01)


def test_what_another_servo_says_in_its_name_is_not_seen(waist):
    """A servo that had another's ID for a moment put a joint that stood at its goal into another turn."""
    rig = waist.open()
    waist.play(0.3, 1.0)
    (port,) = rig._all_ports()
    waist.servo.bank.shaft[0] = waist.joint.pulses(1.4)
    waist.play(0.3, 0.03)
    assert rig.positions[0] > 0.6
    assert port.believed[0, 0] == pytest.approx(0.3, abs=0.01)
    waist.play(0.3, 2.0)
    waist.play(-0.3, 1.5)
    assert port.believed[0, 0] == pytest.approx(waist.angle, abs=0.02)


class Shows:
    """A bus on which a servo shows this position."""

    def __init__(self, pulses):
        self.pulses = pulses

    def read(self, id, address, length):
        return SimpleNamespace(params=self.pulses.to_bytes(4, "little", signed=True))


ANGLES = st.floats(-1.7, 1.7)


@given(ANGLES, ANGLES, st.floats(-2.2, 2.2), st.floats(1.5, 6.0), st.sampled_from([1, -1]), st.integers(-9, 9))
def test_a_turn_is_taken_only_where_no_other_is_possible(seen, goal, angle, gear, direction, lost):
    """Possible are those in which it stands between where it was seen and its goal, or at most a quarter off."""
    joint = RigJoint("waist", 1, "XM540-W270", direction, 2048, -1.745, 1.745, 1.0, gear=gear)
    assume(joint.several_turns)
    turn = 2.0 * np.pi / gear
    shown = round(joint.pulses(angle)) + lost * 4096
    bus, config = Shows(shown), RigConfig("p", 1_000_000, 100.0, (joint,))
    low, high = min(seen, goal), max(seen, goal)
    turns = angle + np.arange(-12, 13) * turn
    possible = turns[(turns > low - 0.249 * turn) & (turns < high + 0.249 * turn)]
    sure = (low - 0.249 * turn < angle < high + 0.249 * turn) and max(high - angle, angle - low) < 0.499 * turn
    try:
        (zero,) = find_zeros(config, bus, np.array([[seen], [goal]]))
    except RigError:
        assert not sure
        return
    found = (shown - zero) / joint.pulses_per_radian
    nearly = turns[(turns > low - 0.251 * turn) & (turns < high + 0.251 * turn)]
    assert len(possible) <= 1
    assert np.abs(nearly - found).min() < 0.002
    if low - 0.25 * turn < angle < high + 0.25 * turn:
        assert found == pytest.approx(angle, abs=0.002)


def test_a_kill_right_after_such_a_restart_does_no_harm(tmp_path):
    """The servo has its indirect addresses again, so what is kept must already be of its new count."""
    waist = Waist(tmp_path, faults=["reboot:id=1,at=3.0"])
    store_turns(waist.config, waist.bus, waist.file)
    waist.open()
    waist.play(1.6, 2.5)
    while not waist.rig.recoveries:
        waist.rig.collect_state()
        waist.rig.write(np.array([1.6]))
        waist.port.elapse(0.01)
    assert waist.open().positions[0] == pytest.approx(waist.angle, abs=0.01)


@pytest.mark.parametrize("angle", [-1.6, 1.6])
@pytest.mark.parametrize("moment", range(7))
def test_one_that_restarts_at_any_moment_of_being_held_is_held_in_its_turn_or_not_at_all(
    waist, monkeypatch, angle, moment
):
    """Its zero had been found before, its place was read after, and the rig took it for a turn farther on."""
    waist.open()
    waist.play(angle, 3.0)
    send, sent = waist.port.send, []

    def restart(data):
        sent.append(data)
        if len(sent) == moment + 1:
            waist.servo.reboot(waist.port.now())
        return send(data)

    monkeypatch.setattr(waist.port, "send", restart)
    found = np.zeros(0)
    with suppress(RigError):
        found = hold_still(waist.config, waist.bus, np.array([angle])).angles
    assert len(sent) > moment
    assert np.abs(found - waist.angle).max(initial=0.0) < 0.05


@pytest.mark.parametrize("target", [1.6, -1.6])
def test_one_that_restarts_in_the_last_tick_is_not_kept_in_another_turn(tmp_path, target):
    """A P servo keeps its indirect cells, so the new count was read, and kept as if it stood a turn farther on."""
    waist = Waist(tmp_path, "PH54-200-S500")
    store_turns(waist.config, waist.bus, waist.file)
    rig = waist.open()
    waist.play(target, 3.0)
    waist.cut_power()
    (port,) = rig._all_ports()
    for _ in range(3):
        port.request_state()
        waist.port.elapse(0.01)
        port.collect_state(waist.port.now())
    assert abs(rig.positions[0] - target) > HALF
    rig.close()
    assert not waist.kept.stands


def test_a_joint_that_another_turn_than_its_goal_has_stops_the_rig(waist):
    """Its servo restarts while it is turned by more than a quarter of a turn of its horn."""
    waist.open()
    waist.play(1.0, 2.0)
    waist.cut_power(1.0 + 0.8 * HALF)
    with pytest.raises(RigError, match="is not where it was, and may stand in another turn"):
        waist.play(1.0, 3.0)
    assert waist.rig.close() == []
    waist.cut_power()
    with pytest.raises(RigError, match=r"was moving|degrees from where it was left"):
        waist.open()


@pytest.mark.parametrize("text", ["", "{", "[]", json.dumps({"1": {"zero": 0}}), json.dumps({"x": 1})])
def test_a_damaged_file_is_none(waist, text):
    waist.file.path.write_text(text)
    with pytest.raises(RigError, match="was not stored"):
        waist.open()


def test_files_of_two_adapters_are_apart_and_beside_others_servos(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    one, other = TurnFile.of_port("/dev/ttyUSB0"), TurnFile.of_port("/dev/ttyUSB1")
    one.keep({1: Turn(0, 5, True)})
    one.keep({2: Turn(0, 7, False)})
    other.keep({1: Turn(4096, 5, True)})
    assert TurnFile.of_port("/dev/ttyUSB0").read() == {1: Turn(0, 5, True), 2: Turn(0, 7, False)}
    assert one.path.parent == tmp_path / "motiondeck"


@pytest.mark.parametrize(("at", "turns"), [(0.3, 0), (-0.9 * HALF, 0), (0.3, 2)])
def test_a_hand_puts_it_near_its_zero(waist, at, turns):
    waist.file.path.unlink()
    loosen(waist.config, waist.bus)
    waist.servo.bank.shaft[0] = waist.joint.pulses(at)
    waist.servo.bank.drive.forgotten[0] = -turns * 4096
    waist.port.elapse(0.01)
    assert store_turns(waist.config, waist.bus, waist.file) == {"waist": pytest.approx(at, abs=0.002)}
    assert waist.open().positions[0] == pytest.approx(at, abs=0.002)


def test_a_calibration_stores_the_turn_too(waist):
    waist.file.path.unlink()
    sweep = Sweep(waist.config)
    loosen(waist.config, waist.bus)
    for step, angle in enumerate([0.0, 0.8, 1.9, 0.8, -0.4, -1.9, -1.0]):
        waist.angle = angle
        for joint, pulses in positions(waist.config, waist.bus):
            sweep.see(joint.name, pulses)
        if step == 0:
            sweep.zero_here("waist")
    found, notes = sweep.result()
    assert notes == []
    assert (found.joints[0].lower, found.joints[0].upper) == (
        pytest.approx(-1.88, abs=0.01),
        pytest.approx(1.88, abs=0.01),
    )
    keep_turns(found, waist.bus, waist.file, sweep.turns)
    waist.config = found
    assert waist.open().positions[0] == pytest.approx(-1.0, abs=0.01)


def test_doctor_and_teaching_know_the_turn(waist, monkeypatch):
    monkeypatch.setattr(TurnFile, "of_port", lambda port: waist.file)
    waist.open()
    waist.play(1.6, 2.5)
    waist.rig.close()
    assert examine(waist.config, waist.bus).servos[0].position == pytest.approx(1.6, abs=0.02)
    moments = watch_hands(waist.config, [(waist.config, waist.bus)], waist.port.elapse)
    assert next(moments).angles[0] == pytest.approx(1.6, abs=0.02)
    waist.cut_power(0.8)
    assert any("from where it was left" in problem for problem in examine(waist.config, waist.bus).problems)
    with pytest.raises(RigError, match="from where it was left"):
        next(watch_hands(waist.config, [(waist.config, waist.bus)], waist.port.elapse))


def test_a_full_disk_is_an_incident_and_stops_nothing(waist, monkeypatch):
    waist.open()
    monkeypatch.setattr("hardware.rig.turn_file.write_file", lambda path, data: (_ for _ in ()).throw(OSError("full")))
    waist.play(0.5, 1.0)
    assert "the turns of its joints cannot be kept: full" in waist.rig.incidents[-1].what
    assert waist.angle > 0.4
