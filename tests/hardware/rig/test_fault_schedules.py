"""Random fault schedules end well, and would notice a rig whose source is broken.

More of them:  python -m benchmarks fault_schedules 500     python -m benchmarks fault_schedules 20 --mutants
"""

import threading
from collections import Counter
from functools import partial

import msgspec
import numpy as np
import pytest

from benchmarks.rig._schedules import Schedule, kinds_of, schedule
from benchmarks.rig.actuator_judge import ActuatorJudge
from benchmarks.rig.burdens import Burdens
from benchmarks.rig.fault_schedules import forgotten, play, run
from benchmarks.rig.judged_port import JudgedBus, JudgedPort
from benchmarks.rig.schedule_judge import ShaftJudge, swings
from benchmarks.rig.source_mutants import MUTANTS, Mutant, mutated
from benchmarks.rig.taking_turns import Turns
from hardware.emulator.faults import Fault, FaultPlan
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.rig_joint import SecondServo
from hardware.rig.switching.torque import hold_still


@pytest.mark.parametrize("seed", [0, pytest.param(10, marks=pytest.mark.thorough)])
def test_a_random_schedule_of_faults_ends_well(seed):
    assert run(seed).problems == []


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("seed", "was"),
    [
        (351844669, "a weight that appeared on the horn when torque was on already"),
        (351844661, "a servo that took another's ID just before speeds were sent"),
        (900015, "such a servo, whose supply came back where the rig could not ease it"),
        (900047, "a restart between two readings, taken for another turn"),
        (900075, "a restart of one of two servos, taken for a horn that has slipped"),
        (900220, "two servos that are read one after the other, taken for one that has slipped"),
        (900129, "a shaft that was held while it snapped back from a jam"),
        (701777939, "a joint that waited for a moment, taken for one that has caught up"),
        (701777976, "torque on one of two servos while the other one still moved"),
        (701778160, "a path that had gone after another joint's goals, against the other servo's"),
        (701778032, "a gripper that shall open, taken for one that lets go"),
        (810000097, "a joint of several turns whose power was off while its goal went on"),
        (810002116, "a joint that one of its two servos stopped while the other went after another joint's goals"),
        (810002358, "a partner without a path whose goal was set ahead of it again and again"),
        (295192571, "one of two servos that leapt back where the other was let go"),
        (295200156, "a loaded joint that sank while its servos were silent"),
        (295310009, "a joint that had yielded, and hurried after it was set up again"),
        (295310150, "goals that let go of a shaft, taken for such as drive it on"),
        (295310034, "one of two servos that heard another's goal for a moment while both turned back"),
        (295900019, "a joint at 85 % of its current, which gave way in the end"),
        (440000052, "what another servo said in its name, taken for where a joint of several turns was"),
        (420000046, "a servo that was replaced by another model, and kept in another turn"),
        (310000001, "two servos without a path, one of which had gone after another joint's goals"),
        (295900202, "a joint of several turns whose power went far behind its goal, taken for one in another turn"),
        (295200253, "a servo without a path that had to hold while it braked to turn back"),
        (701778053, "a restart after the end, taken for a joint that does not hold"),
        (460000000, "a servo that was swapped between the check of its model and its torque"),
        (440000046, "a weight that with its friction was more than its joint could lift"),
        (700000170, "a joint that a jam threw out of its limits, and whose watchdog stopped it there"),
        (600000151, "torque on a limp joint whose weight swung on since its place was read"),
        (700000652, "a restart of a servo that held its partner, which had gone after another joint's goals"),
        (782342047, "one of two servos that pulled with all its current at the other, out of reach, and at its shaft"),
    ],
)
def test_a_schedule_that_was_wrong_ends_well(seed, was):
    assert run(seed).problems == [], was


@pytest.mark.thorough
def test_another_servos_speed_is_taken_back():
    """At one of these moments speeds are just under way, and the slow joint's servo hears the fast one's."""
    slow, fast = (
        RigJoint(f"joint_{id}", id, "XM430-W350", 1, 2048, -1.3, 1.3, velocity) for id, velocity in ((1, 0.4), (2, 3.0))
    )
    usual = schedule(0)
    burdens = Burdens(*np.zeros((2, 2)), *np.zeros((2, 2), dtype=bool), np.ones(2, dtype=np.int64))
    config = msgspec.structs.replace(usual.config, joints=(slow, fast), on_exit="off")

    def plan(at):
        targets = partial(_to_and_fro, np.array([0.0, 1.2]))
        duplicate = [Fault("duplicate", 1, at, 0.6)]
        return Schedule(config, duplicate, "close", np.zeros(2), np.zeros(2), targets, False, burdens)

    moments = np.linspace(2.02, 2.06, 5)
    assert [play(plan(at), 0).problems for at in moments] == [[]] * len(moments)
    with mutated(MUTANTS["another's speed kept"]):
        problems = [play(plan(at), 0, until_wrong=True).problems for at in moments]
    assert "joint_1 kept another's speed" in str(problems)


def _to_and_fro(reach, now):
    return reach * np.sin(2.0 * now)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "seed", "noticed"),
    [
        ("no goal := present", 0, "from its goal"),
        ("torque beside a swing", 600000151, "from its goal"),
        ("no speed limit", 310, "was too fast"),
        ("no acceleration limit", 101, "was accelerated too hard"),
        ("no braking distance", 305, "moved at another's recovery"),
        ("goal := present under load", 305, "moved at another's recovery"),
        ("gains overwritten", 303, "lost its gains at switch-on"),
        ("mode without a limit of current", 301, "had a true current above the rig file's limit"),
        ("own gains not set", 900023, "lost its gains at switch-on"),
        ("a third more current", 900000, "had a true current above the rig file's limit"),
        ("gripper that yields", 900002, "let go of what it gripped"),
        ("gripper that lets go", 900011, "let go of what it gripped"),
        ("caught up while it waits", 600000091, "caught up too fast"),
        ("path of one of two astray", 701778160, "work against each other"),
        ("one of two leaps back", 295192571, "was too fast"),
        ("goals run away from a silent joint", 810000097, "may stand in another turn"),
        ("old place of one of two", 900075, "rad apart"),
        ("one of two goes on alone", 900083, "driven on without its other servo"),
        ("times of two unlike", 900220, "rad apart"),
        ("goal given up in a silence", 295200156, "moved at another's recovery"),
        ("paths that part", 295310034, "work against each other"),
        ("pull at one out of reach", 782342047, "was too fast"),
        ("goal taken for a path", 295200253, "ran past the goal at which it was held"),
        ("no identity check", 70005, "torque came on in another model's servo"),
    ],
)
def test_a_broken_source_is_noticed_while_it_runs(name, seed, noticed):
    with mutated(MUTANTS[name]):
        assert noticed in "; ".join(run(seed, until_wrong=True).problems)


@pytest.mark.thorough
def test_torque_beside_a_moving_partner_is_noticed_where_its_cure_is_broken_too():
    """Servos that work against each other are held together after 0.2 s, which the judge allows."""
    with mutated(MUTANTS["torque beside a moving partner"]):
        assert "work against each other" in "; ".join(run(701777976, until_wrong=True).problems)


@pytest.mark.thorough
def test_a_source_that_leaves_torque_on_is_noticed_at_the_end():
    with mutated(MUTANTS["no switch-off"]):
        assert "wrong torque after the close" in "; ".join(run(10).problems)


def test_a_gripper_lets_go_when_it_presses_no_more_and_not_when_it_is_asked_to_open():
    jaw = RigJoint("jaw", 1, "XM430-W350", -1, 2048, -1.0, 1.0, 2.0, current=0.5, grip=True)
    config = RigConfig("emulated", 1_000_000, 100.0, (jaw,))
    bus, said, now = JudgedBus(config), [], 0.0
    drive, judge = bus.devices[0].bank.drive, ActuatorJudge(config, bus)

    def press(target, share, seconds):
        nonlocal now
        drive.current[0] = -share * 0.5 / 2.3
        for _ in range(round(100 * seconds)):
            now += 0.01
            judge.asked(np.array([target]))
            judge.watch(now, 0.01, *np.zeros((2, 1)), np.array([False]), np.array([True]), note)

    def note(what, where, values):
        said.extend([what] * int(where.any()))

    drive.jammed[0] = True
    press(-0.8, -1.0, 0.6)
    for share in (-1.0, -0.5, 0.0, 0.5):
        press(0.8, share, 0.3)
    assert said == []
    press(0.8, 1.0, 0.5)
    press(0.8, 0.3, 0.2)
    assert "let go of what it gripped" in said[0]


@pytest.mark.parametrize(("sign", "alone"), [(1.0, True), (-1.0, False)])
def test_one_of_two_is_driven_on_by_goals_that_leave_its_shaft_and_not_where_they_come_back_to_it(sign, alone):
    """A joint that yields goes where its shaft stands, also while its other servo is away."""
    joint = RigJoint("arm", 1, "XM430-W350", 1, 2048, -1.0, 1.0, 2.0, second=SecondServo(2, 1, 2048))
    config = RigConfig("emulated", 1_000_000, 100.0, (joint,)).servos
    bus, said, usual = JudgedBus(config), [], np.zeros(2, dtype=bool)
    bus.devices[0]["torque_enable"], bus.devices[1].dead, judge = 1, True, ActuatorJudge(config, bus)

    def note(what, where, values):
        said.extend([what] * int(where.any()))

    for tick in range(50):
        goals = np.full(2, 0.6 + sign * 0.01 * tick)
        judge.watch(0.01 * tick, 0.01, np.zeros(2), goals, usual, ~usual, note)
    assert ("was driven on without its other servo, s" in said) == alone


@pytest.mark.parametrize(
    ("astray", "lets_go", "named"),
    [(True, "restart", False), (False, "restart", True), (True, "torque", True), (True, "goal", True)],
)
def test_a_shaft_may_hurry_after_a_servo_out_of_reach_only_when_its_other_one_restarts(astray, lets_go, named):
    """The second servo goes ahead, and the first one stands until it lets go."""
    joint = RigJoint("arm", 1, "XM430-W350", 1, 2048, -1.3, 1.3, 0.8, second=SecondServo(2, 1, 2048))
    config = RigConfig("emulated", 1_000_000, 100.0, (joint,))
    bus, usual = JudgedBus(config), np.zeros(2, dtype=np.bool_)
    port = JudgedPort(bus, "emulated", FaultPlan(), Turns("none"))
    burdens = Burdens(np.zeros(2), np.zeros(2), usual, usual, np.ones(2, dtype=np.int64))

    def go_ahead(device, most):
        device["profile_velocity"], device["goal_position"] = most, 2648
        device.bank.pursue(device.row)

    first, second = bus.devices
    first["torque_enable"] = second["torque_enable"] = 1
    judge = ShaftJudge(config.servos, port, bus, lambda now: (usual, np.array([False, astray])), burdens)
    go_ahead(second, round(0.8 * 60.0 / (2.0 * np.pi) / 0.229))
    port.elapse(0.25)
    assert judge.problems == []
    if lets_go == "restart":
        first.reboot(1.0)
    elif lets_go == "torque":
        first["torque_enable"] = 0
    else:
        go_ahead(first, 0)
    port.elapse(0.1)
    assert ("arm was too fast" in str(judge.problems)) == named


@pytest.mark.parametrize(("turning", "named"), [(-1.1, False), (0.0, True), (0.6, True)])
def test_a_joint_far_behind_is_forgotten_unless_it_turns_towards_its_target(turning, named):
    """One that has just turned back is where it was half a second ago, and was called forgotten."""
    joint = RigJoint("hand", 1, "XM430-W350", 1, 2048, -1.3, 1.3, velocity=2.5, acceleration=4.0)
    said = forgotten((joint,), *(np.array([value]) for value in (0.94, turning, 0.52, 1.35)))
    assert said == ["hand is forgotten: 0.94 rad instead of 0.52"] * named


@pytest.mark.parametrize("loop", [0.3, 0.6, 0.88])
def test_a_shaft_swings_about_its_path_at_most_as_much_as_the_judge_allows(loop):
    """Against the loop in steps of 10 us, on a path that turns back at every swing."""
    lag, dt = 0.015, 1e-5
    half_swing = np.pi / np.sqrt(loop / lag**2 - 0.25 / lag**2)
    shaft = speed = path = fastest = 0.0
    for step in range(40_000):
        pace = 1.0 if step * dt // half_swing % 2 else -1.0
        path += pace * dt
        speed += (loop / lag * (path - shaft) - speed) * dt / lag
        shaft += speed * dt
        fastest = max(fastest, abs(speed))
    assert fastest == pytest.approx(swings(loop), rel=5e-3)


@pytest.mark.parametrize("name", MUTANTS)
def test_every_mutant_still_has_its_text_in_the_source(name):
    with mutated(MUTANTS[name]):
        pass


def test_a_mutant_whose_text_is_gone_is_named():
    with pytest.raises(ValueError, match="hold_still no longer has"), mutated(Mutant(hold_still, "no such text", "")):
        pass


def test_an_abandoned_thread_ends_silently(monkeypatch):
    said = []
    monkeypatch.setattr(threading, "excepthook", said.append)
    turns = Turns("abandoned")
    thread = threading.Thread(target=turns.wait_until, args=(1.0,), name="abandoned")
    thread.start()
    assert turns.next_due() == 1.0
    turns.abandon()
    assert not thread.is_alive()
    assert said == []


def test_schedules_come_from_their_seed():
    one, same, other = schedule(5), schedule(5), schedule(6)
    assert (one.faults, one.config) == (same.faults, same.config)
    assert np.array_equal(one.targets(1.0), same.targets(1.0))
    assert one.faults != other.faults


def test_each_kind_of_joint_comes_up_in_a_fifth_of_the_schedules_or_more():
    kinds = Counter(kind for seed in range(200) for kind in kinds_of(schedule(seed)))
    asked = ("two servos on a joint", "several turns", "a gripper", "own gains", "a range across the horn's zero",
             "a small limit of current")  # fmt: skip
    assert min(kinds[kind] for kind in asked) > 40
