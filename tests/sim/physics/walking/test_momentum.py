import mujoco
import numpy as np
import pytest

from sim.models.gravity import GRAVITY
from sim.physics.walking.momentum import Momentum

DT, AHEAD, OMEGA, SOLE = 0.005, 1.2, 4.0, 0.1
# A trunk of 0.25 kg m^2 that turns about y on a free base too small to matter.
TRUNK = """
<mujoco>
  <worldbody>
    <body name="base" pos="0 0 0.6">
      <freejoint/>
      <geom type="sphere" size="0.01" mass="0.001"/>
      <body name="trunk">
        <joint name="lean" axis="0 1 0"/>
        <inertial pos="0 0 0" mass="30" diaginertia="0.25 0.25 0.25"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
INERTIA, WEIGHT = 0.25, 30.001 * GRAVITY


def played(angles):
    """Of a trunk that is to lean by `angles`, AHEAD later: how far it does, how softened, and the shift, each tick."""
    model = mujoco.MjModel.from_xml_string(TRUNK)
    momentum, lag = Momentum(model, DT, AHEAD, OMEGA, SOLE), round(AHEAD / DT)
    goal, rows = model.qpos0.copy(), []
    for tick, angle in enumerate(angles):
        goal[7] = angle
        momentum.add(goal)
        posture = model.qpos0.copy()
        posture[7] = angles[max(tick - lag, 0)]
        momentum.soften(posture)
        rows.append((posture[7], momentum.softened, *momentum.shift))
    return np.array(rows)


def swaying(amplitude, hertz=2.0, seconds=5.0):
    return amplitude * np.sin(2.0 * np.pi * hertz * DT * np.arange(round(seconds / DT)))


def test_a_calm_motion_is_played_as_it_is():
    angles, lag = swaying(0.2), round(AHEAD / DT)
    rows = played(angles)
    assert np.all(rows[:, 1:] == 0.0)
    assert np.array_equal(rows[lag:, 0], angles[:-lag])


def test_what_would_throw_the_robot_over_is_softened_without_a_delay():
    angles, lag = swaying(2.0), round(AHEAD / DT)
    rows = played(angles)[2 * lag :]
    assert np.all(rows[:, 1] == 1.0)
    wanted = angles[lag:][: len(rows)]
    kept = float(rows[:, 0] @ wanted / (wanted @ wanted))
    assert 0.2 < kept < 0.7
    assert np.abs(rows[:, 0] - kept * wanted).max() < 0.02 * np.abs(wanted).max()


def test_only_what_is_quick_is_softened():
    seconds = DT * np.arange(1000)
    slow = 0.3 * np.sin(2.0 * np.pi * 0.3 * seconds)
    quick = np.where((seconds > 2.0) & (seconds < 2.5), 1.5 * np.sin(8.0 * np.pi * (seconds - 2.0)), 0.0)
    rows, lag = played(slow + quick), round(AHEAD / DT)
    assert rows[:, 1].max() == 1.0
    assert np.abs(rows[lag + 400 : lag + 500, 0] - slow[400:500]).max() < 0.5 * quick.max()
    assert np.array_equal(rows[lag + 600 :, 0], slow[600 : 1000 - lag])


def test_the_capture_point_goes_where_the_trunk_will_not_throw_the_robot():
    """With the shift, xi' = omega (xi - p - s) keeps the centre of pressure p where it is planned."""
    angles, lag = swaying(1.2), round(AHEAD / DT)
    rows = played(angles)
    softened, shift = rows[:, 1], rows[:, 2]
    assert softened[-1] == 1.0
    lean = np.gradient(np.gradient(rows[:, 0], DT), DT)
    offset = INERTIA * lean / WEIGHT
    run = np.gradient(shift, DT)
    steady = slice(2 * lag, -10)
    # Of a planned pressure at 0; what is beyond AHEAD is not known.
    assert run[steady] == pytest.approx((OMEGA * (shift - offset))[steady], abs=0.02)
    assert np.abs(rows[:, 3]).max() < 1e-9


def test_it_moves_the_capture_point_by_less_than_half_the_sole():
    rows = played(swaying(3.0, hertz=1.0))
    assert 0.3 * SOLE < np.hypot(rows[:, 2], rows[:, 3]).max() <= 0.4 * SOLE + 1e-12
