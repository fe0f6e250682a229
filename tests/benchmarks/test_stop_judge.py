"""The judge of stopping can fail: made-up recordings of the bus with a freeze, a jump, a late brake, and more."""

import struct
from pathlib import Path

import numpy as np
import pytest

from benchmarks.stop import goal_judge as judge
from benchmarks.stop.bus_relay import ENTRY
from benchmarks.stop.goal_frames import FrameReader, crc, goals_in
from hardware.protocol2 import instructions

ROOT = Path(__file__).parents[2]
PERIOD, STOP = 0.01, 2.0
ACCELERATION, SPEED = 150.0, 4.0  # of the joints that move; the robot allows 160 rad/s^2 and 4.7 rad/s


@pytest.fixture(scope="module")
def joints():
    return judge.joints_of(ROOT / "configs/robots/servo20.toml", ROOT / "configs/rigs/servo20.toml")


def speeds(brakes_at):
    """Speeds of 3 s of full motion, at rest ACCELERATION / SPEED after `brakes_at`."""
    times = np.arange(0.0, 3.0, PERIOD)
    ramp = np.minimum(times * ACCELERATION, SPEED)
    return times, np.clip(np.minimum(ramp, SPEED - (times - brakes_at) * ACCELERATION), 0.0, None)


def turned(speed):
    """Positions whose sense turns each 0.46 s, so that all stay in range; joints 3 and 15 move."""
    sense = 1.0 - 2.0 * (np.arange(len(speed)) // 46 % 2)
    positions = np.zeros((len(speed), 20))
    way = np.cumsum(speed * smooth(sense)) * PERIOD
    positions[:, 3], positions[:, 15] = way, -way
    return positions


def smooth(sense):
    """A sense that turns within the limits."""
    most = 0.9 * ACCELERATION * PERIOD / SPEED
    out, at = [], sense[0]
    for one in sense:
        at += np.clip(one - at, -most, most)
        out.append(at)
    return np.array(out)


def record(folder, joints, times, positions, late=0.0004):
    """A record of sync writes at these times, s, each up to `late` s late."""
    rng = np.random.default_rng(1)
    entries = []
    for at, row in zip(times, positions, strict=True):
        counts = np.rint(joints.zero + row * joints.per_radian).astype(int)
        data = b"".join(struct.pack("<Bi", id, count) for id, count in zip(joints.ids, counts.tolist(), strict=True))
        frame = instructions.sync_write(116, 4, data)
        entries.append(ENTRY.pack(int(1e9 * (100.0 + at + late * rng.random())), 0, len(frame)) + frame)
    file = folder / "bus.record"
    file.write_bytes(b"".join(entries))
    return file


def judged(folder, joints, times, positions, late=0.0004):
    """The worst part of a limit in a made-up record, and how its goals came to stand after STOP."""
    goals = judge.read_goals(record(folder, joints, times, positions, late), joints)
    track = judge.on_grid(goals, joints.period, 103.0)
    worst = max(judge.acceleration_parts(track, joints).max(), judge.velocity_parts(track, joints).max())
    return worst, judge.standstill(track, joints, 100.0 + STOP)


@pytest.mark.parametrize("late", [0.0, 0.0004, 0.006])
def test_braking_at_once_and_within_the_limits_is_found_good(tmp_path, joints, late):
    times, speed = speeds(STOP + 0.02)
    worst, still = judged(tmp_path, joints, times, turned(speed), late)
    assert worst <= 1.0
    assert 0.01 <= still.braking_after <= 0.05
    assert 0.03 <= still.still_after <= 0.09
    assert still.moved == 0.0


def test_a_freeze_in_full_motion_is_far_beyond_the_acceleration_limit(tmp_path, joints):
    times, speed = speeds(9.0)
    alive = times < STOP
    worst, still = judged(tmp_path, joints, times[alive], turned(speed)[alive])
    assert worst > 2.0
    assert still.braking_after < 0.02


def test_a_freeze_of_three_periods_is_one_too(tmp_path, joints):
    times, speed = speeds(9.0)
    passed = (times < STOP) | (times > STOP + 0.025)
    assert judged(tmp_path, joints, times[passed], turned(speed)[passed])[0] > 2.0


def test_a_single_late_frame_is_none(tmp_path, joints):
    times, speed = speeds(9.0)
    passed = np.arange(len(times)) != 160
    assert judged(tmp_path, joints, times[passed], turned(speed)[passed])[0] <= 1.0


@pytest.mark.parametrize("size", [0.02, 0.5])
def test_a_jump_is_beyond_the_limits(tmp_path, joints, size):
    times, speed = speeds(STOP)
    positions = turned(speed)
    positions[250:, 7] += size
    worst, still = judged(tmp_path, joints, times, positions)
    assert worst > 1.0
    assert still.moved == pytest.approx(size, abs=0.002)


def test_a_late_brake_is_late(tmp_path, joints):
    times, speed = speeds(STOP + 0.3)
    worst, still = judged(tmp_path, joints, times, turned(speed))
    assert worst <= 1.0
    assert still.braking_after == pytest.approx(0.3, abs=0.03)


def test_a_joint_that_brakes_later_than_the_others_counts(tmp_path, joints):
    times, speed = speeds(STOP)
    positions = turned(speed)
    positions[:, 9] = turned(speeds(STOP + 0.4)[1])[:, 3]
    assert judged(tmp_path, joints, times, positions)[1].braking_after == pytest.approx(0.4, abs=0.03)


def test_motion_after_the_stop_is_seen(tmp_path, joints):
    times, speed = speeds(STOP)
    again = np.where(times > STOP + 0.5, np.minimum((times - STOP - 0.5) * 0.3, 0.05), 0.0)
    worst, still = judged(tmp_path, joints, times, turned(speed + again))
    assert worst <= 1.0
    assert still.still_after < 0.1
    assert still.moved > 0.005


def test_goals_that_never_stand_are_said(tmp_path, joints):
    times, speed = speeds(9.0)
    assert judged(tmp_path, joints, times, turned(speed))[1].still_after is None


def test_a_servo_set_up_where_it_stands_does_not_jump_but_far_from_its_shaft_is_seen(tmp_path, joints):
    times, speed = speeds(STOP)
    file = record(tmp_path, joints, times, turned(speed))
    count = int(joints.zero[7] + 0.3 * joints.per_radian[7])
    frame = instructions.write(joints.ids[7], 116, struct.pack("<i", count))
    with file.open("ab") as more:
        more.write(ENTRY.pack(int(1e9 * 103.0), 0, len(frame)) + frame)
    goals = judge.read_goals(file, joints)
    shafts = judge.Shafts(100.0 + times, times, np.zeros((len(times), 20)))
    assert judge.set_up_elsewhere(goals, shafts) == pytest.approx(0.3, abs=0.002)


def test_shafts_that_stop_too_hard_or_go_on_are_seen(joints):
    times = np.arange(0.0, 3.0, 0.004)
    positions = np.zeros((len(times), 20))
    positions[:, 3] = np.minimum(times, 1.5) * 4.7
    shafts = judge.Shafts(100.0 + times, times, positions)
    assert judge.shaft_acceleration(shafts, joints) > 1.5
    assert judge.shafts_still_after(shafts, 101.0) == pytest.approx(0.5, abs=0.02)
    assert judge.shafts_still_after(shafts.between(100.0, 101.4), 101.0) is None


def test_frames_are_read_as_the_project_writes_them_stuffed_broken_and_in_pieces():
    goals = {1: -3, 2: 0x00FDFFFF, 3: 2048}
    data = b"".join(struct.pack("<Bi", id, goal) for id, goal in goals.items())
    good = instructions.sync_write(116, 4, data)
    bad = bytearray(good)
    bad[-1] ^= 1
    stream = bytes(bad) + b"\xff\xff" + good + instructions.write(2, 112, struct.pack("<ii", 5, 7))
    reader = FrameReader()
    frames = [frame for at in range(0, len(stream), 5) for frame in reader.feed(stream[at : at + 5])]
    addresses = dict.fromkeys(goals, 116)
    assert [goals_in(*frame, addresses) for frame in frames] == [goals, {2: 7}]
    assert reader.damaged == 1
    assert crc(good[:-2]) == int.from_bytes(good[-2:], "little")
