"""The axis of a servo's plot."""

import numpy as np
import pytest

from motiondeck.page.rig.rig_panel import whole_range


@pytest.mark.parametrize(
    ("angles", "shown"),
    [
        ([-0.1, 0.2], (-5.0, 5.0)),  # noise is not drawn as large as a motion
        ([3.0, 4.0], (0.0, 10.0)),
        ([21.0, 58.0], (20.0, 60.0)),
        ([np.nan, 21.0, 58.0], (20.0, 60.0)),
        ([np.nan], (-5.0, 5.0)),
        ([0.0], (-5.0, 5.0)),
    ],
)
def test_the_axis_ends_at_round_angles_and_shows_ten_degrees_at_least(angles, shown):
    assert whole_range(np.array(angles)) == shown
