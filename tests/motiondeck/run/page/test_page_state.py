"""What a run hands to its page: every picture is of one moment."""

from contextlib import closing
from types import SimpleNamespace

import numpy as np

import synthetic
from controller.deck.deck import Deck
from controller.loop.commands.snapshots import SnapshotSource
from controller.loop.loop import LoopState
from controller.loop.stop_requests import StopRequest
from controller.wire.snapshot_numbers import SnapshotNumbers
from controller.wire.telemetry import StateReader
from motiondeck.page.web.page_state import PageDescription
from motiondeck.run.page.page import Page, PageContents

DT = 0.01


def test_a_motion_that_has_begun_is_not_shown_as_the_next_one(tmp_path):
    deck = Deck(synthetic.small_library(), lambda pose: pose.rotation.ravel(), "march")
    body = SimpleNamespace(model=SimpleNamespace(nq=7))
    stage = SimpleNamespace(qpos=np.zeros(7), behind_s=0.0)
    simulation = SimpleNamespace(stage=stage, robot=body, root="gantry")
    robot = SimpleNamespace(simulation=simulation, pushable=None, guard=None, own_joints=())
    contents = PageContents(deck, [robot], None, None, 0, None, None, None, learns=False)
    stop, loop, snapshots = StopRequest(), LoopState(np.zeros(1), deck.pose), SnapshotSource(deck)
    deck.enqueue("wave")
    deck.enqueue("march")
    seen = set()
    about, numbers = PageDescription(model_file="", robot="", motions=[*deck.motions]), SnapshotNumbers(deck.motions)
    with closing(Page(tmp_path / "state", contents, about)) as page:
        reader = StateReader(tmp_path / "state")
        for _ in range(500):
            deck.update(DT)
            page.show(snapshots.take(stop), loop, None)
            shown = numbers.read(reader.read())
            assert (shown.motion, shown.queue) == (deck.motion, deck.queue)
            seen.add((shown.motion, tuple(shown.queue)))
    assert seen == {("march", ("wave", "march")), ("wave", ("march",)), ("march", ())}
