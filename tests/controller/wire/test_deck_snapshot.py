import math

import msgspec
import numpy as np
import pytest

from controller.wire.messages.deck_snapshot import BlendPart, DeckSnapshot, LockState, Recognized, TickHealth
from controller.wire.messages.replies import State, read_reply
from controller.wire.snapshot_numbers import SnapshotNumbers

NUMBERS = SnapshotNumbers(["walk", "jog"], recognizable=["jog", "wave"], joints=["hip", "knee"])
ALL = DeckSnapshot(
    motion="jog",
    playing="walk",
    way=("jog",),
    queue=["jog", "walk"],
    blend=(BlendPart("jog", 0.25), BlendPart("walk", 0.5)),
    tempo=-0.5,
    commanded_tempo=-1.0,
    phase=0.75,
    lock=LockState("beat", "locked", None, 120.0),
    paused=True,
    switching=True,
    restarts=2,
    at=3.5,
    mode="home",
    approaching=True,
    fallen=True,
    seen=Recognized("wave", 0.5),
    mismatch_s=0.25,
    stuck="knee",
    kept_apart=7,
    tick=700,
    run_s=4.5,
    clock_s=1e5,
    late_us=12.5,
    work_us=250.0,
    overruns=3,
    rate_hz=199.5,
    health=TickHealth(10.0, 90.0, 240.0),
)


def fields_of(snapshot):
    row = np.array(NUMBERS.row(snapshot), dtype=float)
    ends = np.cumsum([*NUMBERS.sizes.values()])
    return {name: row[end - size : end] for (name, size), end in zip(NUMBERS.sizes.items(), ends, strict=True)}


@pytest.mark.parametrize("snapshot", [ALL, DeckSnapshot(motion="walk", playing="walk")])
def test_numbers_give_the_snapshot_back(snapshot):
    assert NUMBERS.read(fields_of(snapshot)) == snapshot


def test_what_is_not_there_is_nan_and_none_of_the_names_is_minus_one():
    fields = fields_of(DeckSnapshot(motion="walk"))
    assert math.isnan(fields["phase"][0])
    assert math.isnan(fields["lock_error_ms"][0])
    assert fields["stuck"][0] == -1.0
    assert np.isnan(fields["queue"]).all()


def test_a_status_reply_is_the_snapshot_with_all_motions():
    sent = State.of(ALL, ["walk", "jog"], 5)
    assert read_reply(msgspec.json.encode(sent)) == sent
    assert (sent.motions, sent.id, sent.seen) == (["walk", "jog"], 5, ("wave", 0.5))


def test_every_value_but_texts_inputs_and_layers_is_sent_as_numbers():
    sent = {name for name in DeckSnapshot.__struct_fields__ if any(f.startswith(name) for f in NUMBERS.sizes)}
    assert set(DeckSnapshot.__struct_fields__) - sent == {"fell_back", "inputs", "layers"}
