"""Two servos turn one joint, the second mirrored: driven as one, and never one against the other."""

import re

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import FaultPlan, parse_fault
from hardware.emulator.handling import Handling
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig, load_rig
from hardware.rig.rig_joint import RigJoint, SecondServo
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.torque import hold_still
from hardware.tools.backup import back_up
from hardware.tools.calibration import Sweep, rejoined
from hardware.tools.doctor import examine, fix_settings
from hardware.tools.rig_writing import save_rig
from motiondeck_base.errors import FileFormatError

STALL = 4.4  # A, of an XM540-W270
BOTH = [2, pytest.param(3, marks=pytest.mark.thorough)]  # ids of the shoulder's servos


class Arm:
    """A shoulder with two XM540, mounted against each other, and an elbow with one servo."""

    model = "XM540-W270"

    def __init__(self, *faults, beside=None, zero=2048, on_exit="off", on_loss="stop", mirrored=-1, **keys):
        limits = {"lower": -1.8, "upper": 1.8, "velocity": 2.0} | keys
        second = SecondServo(3, mirrored, 1900)
        shoulder = RigJoint("shoulder", 2, self.model, 1, 2048, **limits, second=second)
        elbow = RigJoint("elbow", 4, self.model, 1, 2048, -1.8, 1.8, 2.0)
        self.config = RigConfig("emulated", 1_000_000, 100.0, (elbow, shoulder), on_exit=on_exit, on_loss=on_loss)
        self.port = EmulatedPort(EmulatedBus(self.config), True, FaultPlan([parse_fault(fault) for fault in faults]))
        self.elbow, self.first, self.second = self.port.bus.devices
        self.drive = self.first.bank.drive
        self.drive.shaft[self.second.row] += zero - 2048
        self.rig = None

    def open(self):
        self.rig = Rig(self.config, lambda part: Bus(self.port, 1_000_000), False, sleep=self.port.elapse)
        return self

    @property
    def angles(self):
        """Of the shoulder, rad, as each of its horns stands."""
        first, second = self.config.joints[1].servos
        return np.array(
            [
                first.angle(float(self.drive.shaft[self.first.row])),
                second.angle(float(self.drive.shaft[self.second.row])),
            ]
        )

    @property
    def currents(self):
        """What both motors draw, A, in the shoulder's direction."""
        directions = np.array([servo.direction for servo in self.config.joints[1].servos])
        return directions * self.drive.current[[self.first.row, self.second.row]] * STALL

    def play(self, target, seconds):
        """The shoulder's angles and currents, tick by tick."""
        seen = []
        for _ in range(round(100 * seconds)):
            self.rig.collect_state()
            self.rig.write(np.array([0.4, target]))
            self.port.elapse(0.01)
            seen.append((*self.angles, *self.currents))
        return np.array(seen)

    @property
    def torques(self):
        return [device["torque_enable"] for device in (self.first, self.second)]


def test_both_carry_the_joint(monkeypatch):
    arm = Arm().open()
    arm.drive.load[[arm.first.row, arm.second.row]] = 0.3, -0.3
    seen = arm.play(1.2, 3.0)
    assert len(arm.rig.positions) == len(arm.rig.states.positions) == 2
    assert arm.rig.positions == pytest.approx([0.4, arm.angles.mean()], abs=0.01)
    assert np.abs(seen[:, 0] - seen[:, 1]).max() < 0.003
    assert seen[-1, 2:] == pytest.approx([0.3 * STALL] * 2, rel=0.1)
    assert arm.rig.currents[1] == pytest.approx(0.3 * STALL, rel=0.1)
    assert list(arm.rig.incidents) == []
    assert arm.rig.close() == []
    assert arm.torques == [0, 0]


def test_a_weight_that_hangs_on_one_horn_is_carried_by_both():
    arm = Arm().open()
    arm.drive.load[arm.first.row] = 0.4
    assert arm.play(0.8, 3.0)[-1, 2:] == pytest.approx([0.2 * STALL] * 2, rel=0.1)


def test_zeros_a_little_off_show_as_currents_against_each_other():
    arm = Arm(zero=2048 + 50).open()
    arm.play(0.5, 2.0)
    assert arm.currents[0] * arm.currents[1] < 0.0
    assert np.abs(arm.currents).min() > 0.05
    assert any("pull against each other" in incident.what for incident in arm.rig.incidents)


def test_zeros_far_off_are_refused_before_torque_comes():
    arm = Arm(zero=2048 + 100)
    with pytest.raises(
        RigError, match=r"shoulder \(id 2\) stands at 0\.00 rad and shoulder's second servo \(id 3\) at -0\."
    ):
        arm.open()
    assert arm.torques == [0, 0]


@pytest.mark.parametrize("id", BOTH)
def test_one_that_restarts_is_set_up_again_while_the_other_carries(id):
    arm = Arm(f"reboot:id={id},at=3.0").open()
    arm.drive.load[[arm.first.row, arm.second.row]] = 0.15, -0.15
    held = arm.play(0.9, 2.9)[-1]
    seen = arm.play(0.9, 3.0)
    assert arm.rig.recoveries == 1
    assert np.abs(seen[:, :2] - held[:2]).max() < 0.06
    assert arm.torques == [1, 1]
    assert np.abs(seen[:, 2] - seen[:, 3])[-50:].max() < 0.1
    arm.play(-0.5, 4.0)
    assert arm.angles == pytest.approx([-0.5, -0.5], abs=0.05)


@pytest.mark.parametrize("id", BOTH)
@pytest.mark.parametrize("at", [0.4, *(pytest.param(at, marks=pytest.mark.thorough) for at in (0.8, 1.0, 1.2))])
def test_one_that_restarts_in_motion_is_not_taken_for_one_that_has_slipped(id, at):
    """What it had said last is old by then, and the other one takes the joint on; the rig was stopped for it."""
    arm = Arm(f"reboot:id={id},at={at}", velocity=2.5, acceleration=4.0).open()
    arm.play(1.7, 6.0)
    assert arm.rig.recoveries == 1
    assert arm.angles == pytest.approx([1.7, 1.7], abs=0.05)


def longest_fight(seen):
    """For how long the two motors work against each other with more than a seventh of their stall current, s."""
    opposed = (seen[:, 2] * seen[:, 3] < 0.0) & (np.abs(seen[:, 2:]).min(axis=1) > 0.15 * STALL)
    longest = run = 0
    for one in opposed:
        run = run + 1 if one else 0
        longest = max(longest, run)
    return 0.01 * longest


@pytest.mark.parametrize("id", BOTH)
@pytest.mark.parametrize("at", [0.7, 0.9])
def test_one_that_restarts_in_motion_gets_torque_when_the_other_has_come_to_rest(id, at):
    """Before, its path began where the other one's was still going to brake."""
    arm = Arm(f"reboot:id={id},at={at}", velocity=1.5, acceleration=4.0).open()
    seen = arm.play(1.7, 2.5)
    assert arm.rig.recoveries == 1
    assert longest_fight(seen) < 0.2
    assert seen[-1, 0] > 1.2


@pytest.mark.parametrize(("id", "target"), [(2, -0.9), pytest.param(3, 0.9, marks=pytest.mark.thorough)])
def test_one_that_went_after_goals_of_another_joint_comes_back_to_its_partner(id, target):
    """Its path was far off by then, and took its time to come back, against the other one."""
    arm = Arm(f"duplicate:id={id},at=2.0,for=0.6,value=4", current=1.5, acceleration=4.0).open()
    arm.play(target, 2.85)
    assert longest_fight(arm.play(target, 3.0)) < 0.2
    assert arm.torques == [1, 1]


class FeetechArm(Arm):
    """The same with servos that show no path."""

    model = "STS3215"


@pytest.mark.parametrize(("id", "target"), [(2, -0.9), pytest.param(3, 0.9, marks=pytest.mark.thorough)])
def test_so_does_one_that_shows_no_path(id, target):
    """They fought until one had shut down for overload."""
    arm = FeetechArm(f"duplicate:id={id},at=2.0,for=0.6,value=4", acceleration=4.0).open()
    arm.play(target, 2.6)
    assert longest_fight(arm.play(target, 3.0)) < 0.3
    assert arm.torques == [1, 1]


@pytest.mark.parametrize("id", BOTH)
@pytest.mark.parametrize(
    ("lasts", "keys"), [(0.6, {"current": 1.5}), pytest.param(0.9, {}, marks=pytest.mark.thorough)]
)
def test_neither_of_two_leaps_back_when_the_other_is_let_go(id, lasts, keys, monkeypatch):
    arm = Arm(f"duplicate:id={id},at=2.0,for={lasts},value=4", acceleration=4.0, **keys).open()
    arm.play(1.2, 1.9)
    elapse, alone = arm.port.elapse, []

    def watched(seconds):
        for servo, other in ((arm.first, arm.second), (arm.second, arm.first)):
            if servo.torque and not other.torque:
                off = arm.drive.path[servo.row] - arm.drive.shaft[servo.row]
                alone.append(seconds * (abs(off) > 0.1 * arm.config.joints[1].pulses_per_radian))
        elapse(seconds)

    monkeypatch.setattr(arm.port, "elapse", watched)
    arm.play(1.2, 4.0)
    assert sum(alone) < 0.01
    np.testing.assert_allclose(arm.angles, 1.2, atol=0.05)


class SmallArm(Arm):
    """The same with small servos, which reach the rig file's limit of current before they win against each other."""

    model = "XC330-T181"


@pytest.mark.parametrize("lasts", [0.27, *(pytest.param(s, marks=pytest.mark.thorough) for s in (0.21, 0.24, 0.3))])
@pytest.mark.parametrize(("id", "target"), [(2, -1.2), pytest.param(3, 1.2, marks=pytest.mark.thorough)])
def test_a_joint_does_not_leap_back_when_the_servo_gives_way_that_its_other_one_pulls_at(
    id, target, lasts, monkeypatch
):
    """One held its goal with all its current, and pulled the joint along when the other's path turned back."""
    keys = {"current": 0.4, "velocity": 2.5, "acceleration": 20.0}
    arm = SmallArm(f"duplicate:id={id},at=0.9,for={lasts},value=4", **keys).open()
    arm.play(target, 0.8)
    elapse, angles, speeds = arm.port.elapse, [], []

    def watched(seconds):
        elapse(seconds)
        angles.append(arm.angles[0])
        speeds.append(arm.drive.speed[arm.first.row] / arm.config.joints[1].pulses_per_radian)

    monkeypatch.setattr(arm.port, "elapse", watched)
    arm.play(target, 2.2)
    assert np.ptp(angles) > 0.1
    assert np.abs(speeds).max() < 0.6 * 2.5
    np.testing.assert_allclose(angles[-1], target, atol=0.05)


@pytest.mark.parametrize(("id", "end"), [(2, -1.7), pytest.param(3, 1.7, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("lasts", [0.1, pytest.param(0.06, marks=pytest.mark.thorough)])
def test_paths_that_part_in_a_moment_come_together(id, end, lasts):
    """One that hears another joint's goal while both turn back stays behind all the way, and they fought for 1.4 s."""
    arm = Arm(f"duplicate:id={id},at=3.0,for={lasts},value=4", velocity=2.5, acceleration=4.0).open()
    arm.play(end, 2.2)
    arm.play(-end, 0.55)
    assert longest_fight(arm.play(end, 4.0)) < 0.25
    assert arm.rig.recoveries == 1
    np.testing.assert_allclose(arm.angles, end, atol=0.05)


def test_servos_whose_zeros_are_off_are_not_set_up_again_and_again():
    arm = Arm(zero=2048 + 60).open()
    for tick in range(800):
        arm.play(np.sin(0.02 * tick), 0.01)
    assert arm.rig.recoveries == 1


@pytest.mark.parametrize("model", ["AX-12A", "MX-28(1.0)", "XL-320", "STS3215"])
def test_two_that_are_read_one_after_the_other_are_not_apart_while_they_move(model):
    """What the joint moves between two answers was taken for a horn that has slipped, and stopped the rig."""
    middle = 512 if model in ("AX-12A", "XL-320") else 2048
    joints = [
        RigJoint(f"joint_{id}", id, model, 1, middle, -1.2, 1.2, 4.0, second=SecondServo(id + 10, -1, middle))
        for id in (1, 2, 3)
    ]
    config = RigConfig("emulated", 1_000_000, 100.0, tuple(joints))
    port = EmulatedPort(EmulatedBus(config), True)
    rig = Rig(config, lambda part: Bus(port, 1_000_000), False, sleep=port.elapse)
    for tick in range(300):
        rig.collect_state()
        rig.write(np.full(3, np.sin(0.035 * tick)))
        port.elapse(0.01)
    assert np.abs(rig.positions).max() > 0.3
    assert list(rig.incidents) == []


@pytest.mark.parametrize("id", BOTH)
@pytest.mark.parametrize("cause", ["dead:id={},at=2.0,for=1.0", "overheat:id={},at=2.0"])
@pytest.mark.parametrize("on_loss", ["stop", "go on"])
def test_one_that_fails_does_not_leave_the_other_pulling(id, cause, on_loss):
    arm = Arm(cause.format(id), on_loss=on_loss).open()
    most = 0.0
    try:
        for tick in range(500):
            arm.play(1.2 * np.sin(0.02 * tick), 0.01)
            opposed = arm.currents[0] * arm.currents[1] < 0.0
            most = max(most, float(np.abs(arm.currents).min()) * opposed)
    except RigError:
        arm.rig.close()
    assert most < 0.3 * STALL
    if "overheat" in cause:
        assert arm.torques == [0, 0]


def test_the_other_waits_while_one_is_silent():
    arm = Arm("dead:id=3,at=2.0,for=1.0").open()
    arm.play(0.0, 1.9)
    arm.play(1.5, 0.8)
    at = arm.angles
    still = arm.play(1.5, 0.2)
    assert np.abs(still[:, :2] - at).max() < 0.01
    assert np.abs(still[:, 2:]).max() < 0.1 * STALL
    arm.play(1.5, 5.0)
    assert arm.angles == pytest.approx([1.5, 1.5], abs=0.05)


@pytest.mark.parametrize("id", BOTH)
def test_a_loaded_joint_that_stands_keeps_its_goal_while_one_of_its_servos_is_silent(id):
    """It was held where it was seen, lower than its goal by what the load takes."""
    arm = Arm(f"dead:id={id},at=2.0,for=1.4").open()
    arm.drive.load[[arm.first.row, arm.second.row]] = 0.1, -0.1
    sag = 0.9 - arm.play(0.9, 1.9)[-1, 0]
    assert sag > 0.02
    # The watchdog makes the silent one hold where it is, and the other carries more of the load.
    assert 0.9 - arm.play(0.9, 1.2)[:, 0].min() < 1.6 * sag
    assert arm.rig.goals[1] == pytest.approx(0.9)


def test_a_joint_that_falls_silent_in_motion_is_not_sent_back_to_where_it_was_seen():
    arm = Arm("drop:at=1.0,for=0.9").open()
    arm.play(0.0, 0.9)
    assert np.diff(arm.play(1.5, 1.0)[:, 0]).min() > -0.001


def test_their_paths_come_together_while_the_joint_catches_up():
    arm = Arm("dead:id=3,at=2.0,for=0.3").open()
    arm.play(0.0, 1.7)
    while not arm.rig.recoveries:
        arm.play(1.7, 0.01)
    arm.play(1.7, 1.0)
    assert arm.rig.pace.part[1] < 1.0
    assert abs(arm.currents[0] - arm.currents[1]) < 0.02 * STALL


@pytest.mark.parametrize("held_by", ["a missed answer", "a target that is NaN"])
def test_a_joint_that_is_held_for_a_moment_goes_on_catching_up(held_by):
    """Its goal was then where it should go, so it seemed to have arrived, and hurried the rest of the way."""
    arm = Arm("dead:id=3,at=2.0,for=0.3").open()
    arm.play(0.0, 1.7)
    while not arm.rig.recoveries:
        arm.play(1.7, 0.01)
    arm.play(1.7, 0.3)
    arm.second.dead = held_by == "a missed answer"
    arm.play(np.nan if held_by != "a missed answer" else 1.7, 0.05)
    arm.second.dead = False
    speeds = np.diff(arm.play(1.7, 0.8)[:, 0]) / 0.01
    assert arm.rig.recoveries == 1
    assert arm.rig.pace.part[1] < 1.0
    assert 0.3 < speeds.max() < 0.6


def test_one_without_torque_is_held_at_the_place_of_the_other():
    arm = Arm().open()
    arm.drive.load[[arm.first.row, arm.second.row]] = 0.2, -0.2
    arm.play(0.9, 2.0)
    arm.second["torque_enable"] = 0
    arm.port.elapse(0.15)
    servos = arm.config.servos
    held = hold_still(servos, Bus(arm.port, 1_000_000), np.zeros(3)).angles
    assert held[1:] == pytest.approx([0.9, 0.9], abs=0.005)
    assert arm.angles[0] < 0.88


def test_a_horn_that_comes_loose_stops_the_rig():
    arm = Arm().open()
    arm.play(0.5, 1.5)
    arm.drive.joined = arm.drive.joined[:, :0]
    arm.drive.jammed[arm.second.row] = True
    with pytest.raises(RigError, match=r"shoulder \(id 2\) has two servos that are 0\.1\d rad apart"):
        arm.play(-1.0, 3.0)
    assert arm.rig.close() == []
    assert arm.torques == [0, 0]


@pytest.mark.parametrize("hold", [True, False])
def test_both_hold_in_the_end_or_neither(hold):
    arm = Arm().open()
    arm.drive.load[[arm.first.row, arm.second.row]] = 0.1, -0.1
    arm.play(0.7, 2.0)
    at = arm.angles
    assert arm.rig.close(hold=hold) == []
    assert arm.torques == [hold, hold]
    arm.port.elapse(1.0)
    if hold:
        assert arm.angles == pytest.approx(at, abs=0.005)
        assert arm.currents[0] == pytest.approx(arm.currents[1], abs=0.05)


def test_a_limit_of_current_holds_for_each():
    arm = Arm(current=0.6).open()
    arm.drive.jammed[[arm.first.row, arm.second.row]] = True
    seen, yielded = arm.play(1.5, 2.0), []
    for _ in range(20):
        seen = np.concatenate([seen, arm.play(1.5, 0.05)])
        yielded.append(arm.rig.pace.strain.yielding[1])
    assert np.abs(seen[:, 2:]).max() <= 0.6 * 1.01
    assert any(yielded)


def test_a_range_across_the_zero_of_one_horn_alone():
    """The first servo stays in position mode, the second counts turns."""
    arm = Arm(lower=-1.8, upper=3.0)
    assert [servo.mode for servo in arm.config.joints[1].servos] == [3, 4]
    arm.open().play(2.8, 3.0)
    assert arm.angles == pytest.approx([2.8, 2.8], abs=0.03)


def test_commands_of_the_page_take_both():
    arm = Arm().open()
    arm.play(0.3, 1.0)
    arm.rig.switch_off(1)
    arm.play(0.3, 0.3)
    assert arm.torques == [0, 0]
    arm.rig.set_up_again(1)
    arm.play(0.3, 1.0)
    arm.rig.restart(1)
    arm.play(0.3, 2.0)
    assert arm.torques == [1, 1]
    scan = arm.rig.scan()
    arm.play(0.3, 3.0)
    assert scan.missing == []


def test_the_tools_know_both(tmp_path):
    arm = Arm()
    bus = Bus(arm.port, 1_000_000)
    report = examine(arm.config, bus)
    assert [servo.id for servo in report.servos] == [4, 2, 3]
    arm.second["drive_mode"], arm.second["secondary_id"] = 1, 2  # as the maker of the arm leaves it
    assert [name in "".join(examine(arm.config, bus).problems) for name in ("drive_mode", "secondary_id")] == [True] * 2
    assert fix_settings(arm.config, bus).refused == []
    assert (arm.second["drive_mode"], arm.second["secondary_id"]) == (0, 255)
    assert [backup.id for backup in back_up(arm.config, bus)] == [4, 2, 3]
    save_rig(arm.config, tmp_path / "arm.toml")
    assert load_rig(tmp_path / "arm.toml") == arm.config


def shadowed(arm):
    """The second servo does all that is sent to the first, as in an arm that its maker has set up."""
    arm.second["secondary_id"] = 2
    arm.port.bus.reindex()


def test_one_that_does_what_is_sent_to_the_other_is_refused_until_the_doctor_has_mended_it():
    arm, kept = Arm(), []
    shadowed(arm)
    line = (
        "shoulder's second servo (id 3): secondary_id is 2, the rig needs 255 "
        "(it also does all that is sent to that ID)"
    )
    with pytest.raises(RigError) as refused:
        arm.open()
    assert str(refused.value) == f"{line}. Set it with motiondeck rig doctor RIG --fix."
    assert arm.torques == [0, 0]
    bus = Bus(arm.port, 1_000_000)
    assert f"{line}: --fix sets it" in examine(arm.config, bus).problems
    assert fix_settings(arm.config, bus, kept.append).refused == []
    assert [one.registers["secondary_id"] for one in kept if one.id == 3] == [2]
    assert arm.open().play(0.5, 1.0) is not None


@pytest.mark.parametrize("follows", [True, False])
def test_what_takes_the_first_off_drops_the_joint_if_the_second_does_it_too(follows):
    """Why a second ID is refused: while one of two is set up again, the other has to keep its torque."""
    arm = Arm().open()
    arm.drive.load[[arm.first.row, arm.second.row]] = 0.15, -0.15
    held = arm.play(0.9, 2.0)[-1, 0]
    if follows:
        shadowed(arm)
    Bus(arm.port, 1_000_000).write(2, arm.config.joints[1].table["torque_enable"].address, b"\0")
    arm.port.elapse(1.0)
    assert arm.torques == [0, not follows]
    assert (arm.angles[0] < held - 0.3) == follows


def test_a_recovery_finds_a_second_id_that_came_while_the_rig_played():
    arm = Arm().open()
    arm.play(0.9, 1.0)
    shadowed(arm)
    arm.rig.restart(1)
    with pytest.raises(RigError, match=r"\(id 3\): secondary_id is 2, .* --fix"):
        arm.play(0.9, 1.0)
    assert arm.rig.close() == []
    assert arm.torques == [0, 0]


def test_a_servo_beside_the_rig_that_follows_one_of_it_is_named():
    arm = Arm()
    shadowed(arm)
    elbow, shoulder = arm.config.joints
    alone = msgspec.structs.replace(arm.config, joints=(elbow, msgspec.structs.replace(shoulder, second=None)))
    found = [line for line in examine(alone, Bus(arm.port, 1_000_000)).problems if "not in the rig file" in line]
    assert len(found) == 1
    assert found[0].startswith(
        "XM540-W270 with id 3 is not in the rig file, and also does all that is sent to shoulder (id 2)"
    )
    arm.second["secondary_id"] = 255
    assert not any("not in the rig file" in line for line in examine(alone, Bus(arm.port, 1_000_000)).problems)


def test_a_calibration_by_hand_measures_both():
    arm = Arm()
    sweep = Sweep(arm.config.servos)
    rows = {servo.name: servo for servo in arm.config.servos.joints}
    for angle in (0.1, 1.4, -1.2):
        for name, servo in rows.items():
            sweep.see(name, round(servo.pulses(angle)) + 40)
            if angle == 0.1:
                sweep.zero_here(name)
    found, notes = sweep.result()
    (_, shoulder), second = rejoined(arm.config, found).joints, arm.config.joints[1].servos[1]
    assert notes == []
    assert (shoulder.lower, shoulder.upper) == (pytest.approx(-1.28, abs=0.01), pytest.approx(1.28, abs=0.01))
    assert shoulder.second == SecondServo(3, -1, round(second.pulses(0.1)) + 40)
    sweep.reverse("shoulder")
    assert [sweep.measured[name].direction for name in rows] == [1, -1, 1]


def test_hands_move_both_horns_of_an_emulated_joint():
    arm = Arm()
    handling = Handling(arm.config)
    handling.command("move shoulder 0.7 in 0.1")
    for tick in range(20):
        handling.move([arm.port.bus], 0.01 * tick)
    assert arm.angles == pytest.approx([0.7, 0.7], abs=0.001)


ROW = 'id = 2, model = "XM540-W270", direction = 1, zero = 2048, lower = -1, upper = 1, velocity = 2'
FILE = f"""port = "p"
baud = 1_000_000
rate_hz = 100
joints = [
  {{ name = "shoulder", {ROW}, second = {{ id = 3, direction = -1, zero = 2048 }} }},
  {{ name = "elbow", {ROW.replace("id = 2", "id = 4")} }},
]
"""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("id = 3", "id = 4"), "line 6: id 4 is used more than once: joint 1 (shoulder, id 2), joint 2 (elbow, id 4)."),
        (
            ("id = 3", "ide = 3"),
            "line 5: unknown key 'ide' in [joints.1.second]. Did you mean 'id'? Allowed are: direction, id, zero.",
        ),
        (("direction = -1", "direction = 0"), "0 is none of -1, 1 in [joints.1.second.direction]"),
        ((", zero = 2048 }", " }"), "missing key 'zero' in [joints.1.second]"),
    ],
)
def test_a_mistake_in_it_is_one_clear_line(tmp_path, change, said):
    path = tmp_path / "rig.toml"
    path.write_text(FILE)
    assert [servo.id for servo in load_rig(path).servos.joints] == [2, 3, 4]
    path.write_text(FILE.replace(*change))
    with pytest.raises(FileFormatError, match=re.escape(said)):
        load_rig(path)
