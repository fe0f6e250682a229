"""A sync write that is filled again and again has the same bytes as one that is made anew."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.families.dynamixel2 import frames as wire
from hardware.families.models import FAMILIES, USUAL
from hardware.rig.driving.servo_port import SyncWrite

# -131073 is FF FF FD FF on the wire: a header, unless it is stuffed.
GOALS = st.one_of(st.integers(-(2**31), 2**31 - 1), st.sampled_from([-131073, -3, 0, 2048]))


@given(st.lists(st.lists(GOALS, min_size=3, max_size=3), min_size=1, max_size=3))
def test_its_frame_is_that_of_the_present_values(ticks):
    write = SyncWrite([1, 2, 252], 116, 4, USUAL, slice(None))
    for goals in ticks:
        entries = zip((1, 2, 252), goals, strict=True)
        data = b"".join(bytes((id,)) + goal.to_bytes(4, "little", signed=True) for id, goal in entries)
        assert write.frame(np.array(goals, dtype=np.float64)) == wire.sync_write(116, 4, data)


@pytest.mark.parametrize("family", FAMILIES)
def test_two_byte_registers_of_every_family(family):
    write = SyncWrite([5, 7], 30, 2, family, slice(None))
    assert write.frame(np.array([1000.0, 512.0])) == family.instructions.sync_write(30, 2, bytes((5, 0xE8, 3, 7, 0, 2)))
