import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.wire.messages.commands import Push
from motiondeck.page.body.body_push import BodyPush, pushed
from waiting import until


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


def dragged(places, sway=(0.0, 0.0, 0.0)):
    """The push of a drag from the first to the last of some places, m, of a body that sways so far meanwhile."""
    handlers, sent = [], []
    solid = SimpleNamespace(on_drag=handlers.append)
    drawn: Any = SimpleNamespace(solids=[solid])
    BodyPush(drawn, 1.0, 2.0, sent.append)
    scene = SimpleNamespace(add_arrows=lambda *given, **named: None, remove_by_name=lambda name: None)
    camera = SimpleNamespace(look_at=(0.0, 0.0, 0.5), position=(3.0, 0.0, 0.5))
    client = SimpleNamespace(camera=camera, scene=scene)
    for k, place in enumerate(places):
        phase = "start" if k == 0 else "end" if k == len(places) - 1 else "update"
        held = np.array(places[0]) + k / (len(places) - 1) * np.array(sway)
        event = SimpleNamespace(phase=phase, start_position=held, end_position=place, client=client, client_id=1)
        with pytest.raises(StopIteration):  # it waits for nothing; a browser of another test may own the event loop
            handlers[0](event).send(None)
    until(lambda: sent, "the push")
    return sent[0]


DRAG = [(0.0, 0.0, 0.5), (0.0, 0.1, 0.5), (0.0, 0.3, 0.5), (0.0, 0.3, 0.5)]


def test_a_drag_of_a_third_of_the_height_is_a_push_that_one_has_to_step_against():
    assert dragged(DRAG) == Push("back", 2.0, towards=round(math.pi / 2, 3))


def test_a_body_that_sways_meanwhile_gets_the_push_that_the_hand_gave():
    assert dragged(DRAG, sway=(0.1, -0.3, 0.2)) == dragged(DRAG)
