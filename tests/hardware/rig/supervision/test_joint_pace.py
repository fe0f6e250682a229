"""Strain on currents given by hand: when a joint yields, how far it still aims, and when it is itself again."""

import msgspec
import numpy as np
import pytest

from hardware.rig.driving.readings import Measurements
from hardware.rig.scale import RigScale
from hardware.rig.supervision.pace import JointPace, Strain


def strain_of(config):
    """The strain of servos with the gains that they come with."""
    return Strain(config, np.array([joint.slack() for joint in config.joints]))


def held_at(strain, currents, seconds, since=0.0):
    """Notes the same currents for so long; the time afterwards."""
    for tick in range(1, round(seconds / 0.01) + 1):
        strain.note(np.array(currents), since + 0.01 * tick)
    return since + seconds


def test_a_joint_yields_above_three_quarters_of_what_it_may_take_and_not_below(rig_of_four):
    """An XM430 stalls at 2.3 A and may take 0.8 of that for long."""
    strain = strain_of(rig_of_four)
    held_at(strain, [0.74 * 0.8 * 2.3, 0.76 * 0.8 * 2.3, -0.76 * 0.8 * 2.3, 0.0], 3.0)
    assert strain.yielding.tolist() == [False, True, True, False]


def test_a_short_push_is_no_strain(rig_of_four):
    strain = strain_of(rig_of_four)
    now = held_at(strain, [0.0] * 4, 1.0)
    held_at(strain, [2.3, 0.0, 0.0, 0.0], 0.15, now)
    assert not strain.yielding.any()


def test_it_follows_again_below_sixty_per_cent(rig_of_four):
    strain = strain_of(rig_of_four)
    now = held_at(strain, [1.5] * 4, 2.0)
    now = held_at(strain, [0.62 * 0.8 * 2.3] * 4, 3.0, now)
    assert strain.yielding.all()
    held_at(strain, [0.58 * 0.8 * 2.3] * 4, 3.0, now)
    assert not strain.yielding.any()


def test_the_limit_of_the_rig_file_counts_where_it_is_lower(rig_of_four):
    careful = msgspec.structs.replace(rig_of_four.joints[0], current=1.0)
    strain = strain_of(msgspec.structs.replace(rig_of_four, joints=(careful, *rig_of_four.joints[1:])))
    held_at(strain, [0.8] * 4, 3.0)
    assert strain.yielding.tolist() == [True, False, False, False]


def test_a_yielding_joint_aims_as_far_ahead_as_half_of_its_current_needs(rig_of_four):
    """With its gain P = 800 a servo drives 800 / 128 PWM counts a pulse, and 885 of them are full voltage."""
    pulses = 0.5 * 0.8 * 885 * 128 / 800
    assert strain_of(rig_of_four).reach == pytest.approx([pulses * 2.0 * np.pi / 4096] * 4)


def test_a_joint_that_yielded_and_holds_anew_catches_up_as_slowly_as_any(rig_of_four):
    """What it pushed against before let its servo go at full speed."""
    pace = JointPace(rig_of_four, RigScale(rig_of_four), Measurements(4), 0.0)
    held_at(pace.strain, [2.3] * 4, 1.0)
    assert (pace.of_servos == 1.0).all()
    pace.start_again(np.array([1, 2]), 1.0)
    assert pace.of_servos.tolist() == [1.0, 0.25, 0.25, 1.0]
