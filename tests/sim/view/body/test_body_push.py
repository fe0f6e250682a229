import numpy as np
import pytest

from sim.view.body.body_push import pushed


@pytest.mark.parametrize(
    ("view", "drag", "towards"),
    [
        # Seen from the front, who looks along -x has +y on the right and z up.
        ((-1.0, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.3)),
        ((-1.0, 0.0, 0.0), (0.0, 0.0, 0.2), (-0.2, 0.0)),
        ((0.0, 2.0, 0.0), (0.1, 0.0, 0.0), (0.1, 0.0)),
        # From above nothing is foreshortened.
        ((0.0, 0.01, -3.0), (0.1, 0.2, 0.0), (0.1, 0.2)),
        ((0.0, 0.0, -3.0), (0.1, 0.2, 0.0), (0.1, 0.2)),
    ],
)
def test_a_drag_pushes_as_on_the_screen_and_up_is_away(view, drag, towards):
    assert pushed(np.array(drag), np.array(view)) == pytest.approx(np.array(towards), abs=2e-3)
