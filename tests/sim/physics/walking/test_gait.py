import numpy as np
import pytest

from sim.models.robot_file import WalkSettings
from sim.physics.walking.capture_point import planned_capture_point
from sim.physics.walking.gait import Gait
from sim.physics.walking.steps import MEETS, Step, highest, pressure_course, swing_path
from walking_soles import go_after, walking_soles

DT, PREVIEW, OMEGA = 0.01, 1.2, 3.2
SETTINGS = WalkSettings(share=0.5, width=0.2, roll=0.5, ahead=0.9, aside=0.9)


def pendulum(gait, seconds, *, push=0.0, catch=True, **walk):
    """Walks a pendulum that stands on the gait's centre of pressure; where its capture point was, and was to be."""
    capture, rows = np.zeros(2), []
    for now, _ in go_after(gait, walking_soles(seconds + PREVIEW, DT, **walk), DT, PREVIEW):
        times, knots = gait.course(now)
        wanted, effect = np.split(planned_capture_point(times, knots, now, OMEGA), [2])
        if catch:
            wanted = wanted + effect * gait.catch(now, capture - wanted, float(effect[0]))
        pressure = np.array([np.interp(now, times, knots[:, axis]) for axis in range(2)])
        # Ankles keep small errors small, within a foot.
        pressure = pressure + np.clip(1.5 * (capture - wanted), -0.03, 0.03)
        capture = pressure + np.exp(OMEGA * DT) * (capture - pressure)
        if abs(now - 3.0) < 0.5 * DT:
            capture = capture + np.array([0.0, push])
        rows.append((*capture, *wanted))
    return np.array(rows)


def new_gait(widest=2.2 * SETTINGS.width):
    gait = Gait(SETTINGS, 1.0, 0.25, np.array([1.0, -1.0]), widest)
    gait.start(np.zeros(2), 0.0, np.zeros(2))
    return gait


def test_a_pendulum_follows_the_plan_and_goes_the_share_of_the_way():
    rows = pendulum(new_gait(), 8.0, length=0.3, step=0.5)
    off = np.hypot(*(rows[:, :2] - rows[:, 2:]).T)
    assert off.max() < 0.05
    # The motion makes 0.6 m a second; the steps grow at first.
    assert rows[-1, 0] - rows[300, 0] == pytest.approx(SETTINGS.share * 0.6 * 5.0, rel=0.1)


@pytest.mark.parametrize("push", [-0.04, 0.04])
def test_a_push_is_caught_by_steps_and_would_be_a_fall_without(push):
    caught = pendulum(new_gait(), 8.0, push=push, length=0.3, step=0.5)
    assert np.hypot(*(caught[-100:, :2] - caught[-100:, 2:]).T).max() < 0.05
    fallen = pendulum(new_gait(), 8.0, push=push, catch=False, length=0.3, step=0.5)
    assert np.hypot(*(fallen[-1, :2] - fallen[-1, 2:]).T) > 1.0


def test_feet_never_meet_however_hard_the_push():
    gait = new_gait()
    pendulum(gait, 4.2, push=0.5, length=0.3, step=0.5)
    assert abs(gait.places[0, 1] - gait.places[1, 1]) > 0.8 * SETTINGS.width


def widest_step(widest):
    """The largest distance of the feet with wide steps, for a widest stance of `widest`."""
    gait, widths = new_gait(widest), []
    soles, yaws, headings = walking_soles(6.0, DT, length=0.1, step=0.5)
    soles[..., 1] *= 2.5
    for _, ended in go_after(gait, (soles, yaws, headings), DT, PREVIEW):
        if ended is not None:
            widths.append(abs(float(np.subtract(*gait.places)[1])))
    return max(widths)


def test_who_lands_no_foot_farther_aside_steps_as_far_ahead():
    """Of somebody whose feet are a little farther apart than the robot's."""
    lengths = []
    for widest in (2.0 * SETTINGS.width, SETTINGS.width):
        gait = new_gait(widest)
        soles, yaws, headings = walking_soles(6.0, DT, length=0.2, step=0.5)
        soles[..., 1] *= 1.2
        for _ in go_after(gait, (soles, yaws, headings), DT, PREVIEW):
            pass
        lengths.append(float(gait.places[:, 0].max()))
    assert lengths[0] > 0.5
    assert lengths[1] == pytest.approx(lengths[0], rel=0.05)


def test_no_foot_lands_farther_to_its_side_than_it_lands_flat():
    assert widest_step(0.4) > 0.32
    assert 0.28 < widest_step(0.3) <= 0.3
    assert widest_step(SETTINGS.width) == pytest.approx(SETTINGS.width)


@pytest.mark.parametrize("push", [-0.5, 0.5])
def test_no_push_makes_a_step_longer_than_legs_reach(push):
    gait, farthest = new_gait(), 0.0
    pendulum(gait, 3.0, length=0.3, step=0.5)
    for _ in range(100):
        gait.catch(3.0, np.array([push, push]), 0.5)
        assert gait.step is not None
        farthest = max(farthest, float(np.hypot(*(gait.step.place - gait.places[1 - gait.step.foot]))))
    assert farthest < 1.2 * np.hypot(SETTINGS.longest, SETTINGS.width)


def test_the_goal_of_a_swing_moves_no_faster_than_the_foot_can_follow():
    gait, now = new_gait(), 2.85
    pendulum(gait, now + DT, length=0.3, step=0.5)
    _, _, share = gait.swing(now)
    assert 0.5 < share < 0.8
    moved = gait.catch(now, np.array([0.2, 0.0]), 0.5)
    along, _ = swing_path(share)
    assert along * np.hypot(*moved) == pytest.approx(SETTINGS.fastest * DT)


def test_a_step_lasts_until_it_has_ended_in_the_plan_too():
    gait = new_gait()
    for now, _ in go_after(gait, walking_soles(6.0, DT, step=0.16), DT, PREVIEW):
        if gait.step is not None:
            assert gait.step.end > now


def test_who_turns_on_feet_that_stand_turns_only_as_far_as_hips_do():
    gait = new_gait()
    headings = np.linspace(0.0, 2.0, 200)
    facing = [heading + gait.turn(0.01 * k, heading) for k, heading in enumerate(headings)]
    assert np.allclose(facing[:45], headings[:45])
    assert max(facing) == pytest.approx(0.6)
    # And back again at once, when the motion turns back.
    assert 1.5 + gait.turn(2.01, 1.5) == pytest.approx(0.1)


@pytest.mark.parametrize("slipped", [-0.5, 0.5])
def test_steps_turn_back_a_robot_whose_feet_have_slipped(slipped):
    gait, landed = new_gait(), [0.0]
    for now, ended in go_after(gait, walking_soles(9.0, DT, step=0.5), DT, PREVIEW):
        if now > 3.0:
            gait.slipped = slipped
        if ended is not None:
            landed.append(gait.yaws[ended.foot])
    # Against the slip, by little with each step, and no farther.
    assert np.max(np.abs(np.diff(landed))) < 0.15
    assert landed[-1] == pytest.approx(slipped, abs=0.02)
    assert np.max(np.abs(landed)) < 0.52


def test_the_centre_of_pressure_never_jumps():
    gait, before = new_gait(), None
    for now, _ in go_after(gait, walking_soles(6.0, DT, step=0.5), DT, PREVIEW):
        times, knots = gait.course(now)
        assert times[0] <= now
        assert np.all(np.diff(times) > 0.0)
        pressure = np.array([np.interp(now, times, knots[:, axis]) for axis in range(2)])
        # From foot to foot in the least time of double support, and no faster.
        if before is not None:
            assert np.hypot(*(pressure - before)) < 1.05 * DT * 0.4 / SETTINGS.double_support
        before = pressure


@pytest.mark.parametrize("turn", [-0.3, 0.3])
def test_hips_that_turn_with_each_step_leave_the_feet_as_far_apart(turn):
    """A stride is turned to and fro by the hips; its feet keep their tracks, nearer to each other than the robot's."""
    gait, widths = new_gait(), []
    soles, yaws, headings = walking_soles(8.0, DT, length=0.3, step=0.5)
    soles[..., 1] *= 0.5
    times = np.arange(len(headings)) * DT
    headings = headings + turn * np.where(times > 1.0, np.cos(np.pi * (times - 1.0) / 0.5), 0.0)
    for _, ended in go_after(gait, (soles, yaws, headings), DT, PREVIEW):
        if ended is not None:
            widths.append(abs(float(np.subtract(*gait.places)[1])))
    assert len(widths) > 8
    assert np.array(widths[2:]) == pytest.approx(SETTINGS.width, rel=0.05)


def test_who_stands_keeps_the_pressure_between_the_feet():
    gait = new_gait()
    rows = pendulum(gait, 3.0, begins=100.0)
    assert np.abs(rows).max() < 1e-9
    assert gait.step is None


@pytest.mark.parametrize("pause", [0.1, 0.3, 0.6])
def test_between_two_steps_of_one_foot_the_pressure_goes_towards_it_as_far_as_there_is_time(pause):
    places = np.array([[0.0, 0.1], [0.0, -0.1]])
    steps = [
        Step(0, start, start + 0.4, place, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for start, place in [(1.0, np.array([0.1, 0.1])), (1.4 + pause, np.array([0.2, 0.1]))]
    ]
    times, knots = pressure_course(0.9, None, places, np.zeros(2), steps, 0.0)
    moments = np.linspace(1.4, 1.4 + pause, 50)
    aside = np.interp(moments, times, knots[:, 1])
    assert aside[-1] == pytest.approx(-0.1)
    # Half a second takes it to the middle between the feet.
    assert aside.max() == pytest.approx(-0.1 + 0.1 * min((pause + MEETS) / 0.5, 1.0), abs=0.005)


def test_a_swinging_foot_leaves_and_lands_softly():
    shares = np.linspace(0.0, 1.0, 201)
    along, high = np.array([swing_path(share) for share in shares]).T
    assert (along[0], along[-1], high[0], high[-1]) == (0.0, 1.0, 0.0, 0.0)
    assert high.max() == pytest.approx(1.0)
    speed = np.diff(along) * 200.0
    assert speed.min() >= 0.0
    assert speed.max() < 1.4
    assert speed[0] < 0.05 > speed[-1]


@pytest.mark.parametrize("seconds", [0.2, 0.3, 0.5])
def test_a_quick_foot_comes_down_by_less_than_a_height_a_second(seconds):
    high = np.array([highest(0.1, seconds) * swing_path(share)[1] for share in np.linspace(0.0, 1.0, 201)])
    assert np.abs(np.diff(high)).max() * 200.0 / seconds < 1.0
    assert high.max() >= 0.05


def test_of_a_slow_step_most_is_spent_on_both_feet():
    gait, swinging = new_gait(), 0.0
    for _ in go_after(gait, walking_soles(14.0, DT, step=2.0), DT, PREVIEW):
        swinging = swinging + DT if gait.step is not None else 0.0
        assert swinging < 1.2
    assert gait.places[:, 0].max() > 0.4


def test_strides_that_are_too_long_or_too_quick_become_shorter():
    long = new_gait()
    pendulum(long, 6.0, catch=False, length=2.0, step=0.5)
    assert abs(long.places[0, 0] - long.places[1, 0]) <= SETTINGS.longest + 1e-9
    quick = new_gait()
    pendulum(quick, 6.0, catch=False, length=0.9, step=0.3)
    assert abs(quick.places[0, 0] - quick.places[1, 0]) < 0.5 * SETTINGS.fastest * 0.35
