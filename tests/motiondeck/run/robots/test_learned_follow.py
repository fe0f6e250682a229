"""What a rig has learned is kept with all that it was learned with, and forgotten when that changes."""

from contextlib import ExitStack
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

import synthetic
from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits
from controller.loop.lead import Lead
from hardware.rig.rig_file import FollowConfig, load_rig
from motiondeck.run.robots.learned_follow import load, open_correction, save
from motiondeck_base.shipped import find_rig

LIBRARY = synthetic.small_phase_library()
LIMITS = JointLimits(*(np.full(20, x) for x in (-2.0, 2.0, 4.7, 160.0, 12000.0)))
RIG = msgspec.structs.replace(load_rig(find_rig("servo20")), follow=FollowConfig(learn=True))
KEY = ("march", 0)


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


def opened(opening, config=RIG, *, robot="servo20", emulated=False):
    deck = Deck(LIBRARY, lambda pose: np.zeros(20), "march")
    output = SimpleNamespace(rig=SimpleNamespace(config=config), correction=None)
    about = {"robot": robot, "library": LIBRARY.info, "emulated": emulated}
    found = open_correction(opening, output, deck, Lead([], 20, 0.005), LIMITS, 0.005, **about)
    assert found is output.correction
    return found


def learn(value):
    with ExitStack() as opening:
        opened(opening).tables[KEY] = np.full((40, 20), value)


def tables(**changes):
    with ExitStack() as opening:
        return dict(opened(opening, **changes).tables)


def test_what_was_learned_is_there_in_the_next_run_and_learned_on():
    learn(0.01)
    assert np.allclose(tables()[KEY], 0.01)
    learn(0.02)
    assert np.allclose(tables()[KEY], 0.02)


def test_it_is_forgotten_when_the_rig_file_the_robot_or_the_servos_change():
    learn(0.01)
    slower = msgspec.structs.replace(RIG.joints[3], velocity=4.0)
    other = msgspec.structs.replace(RIG, joints=(*RIG.joints[:3], slower, *RIG.joints[4:]))
    assert tables(config=other) == {}
    assert tables(robot="mannequin") == {}
    assert tables(emulated=True) == {}
    assert np.allclose(tables()[KEY], 0.01)


def test_a_rig_file_that_does_not_ask_for_it_learns_nothing(state):
    with ExitStack() as opening:
        assert opened(opening, load_rig(find_rig("servo20"))) is None
    assert [*state.rglob("*.safetensors")] == []


def test_a_broken_file_is_forgotten_and_one_that_cannot_be_written_is_reported(state, capsys):
    learn(0.01)
    (file,) = state.rglob("*.safetensors")
    file.write_bytes(b"no tables at all")
    assert tables() == {}
    file.unlink()
    file.mkdir()
    learn(0.01)
    assert "what the rig has learned is not kept" in capsys.readouterr().err


def test_tables_that_say_nothing_or_are_not_finite_are_left_out(tmp_path):
    file = tmp_path / "tables.safetensors"
    bad = np.zeros((9, 2))
    bad[0] = np.nan
    save(file, "x", {("a b", -2): np.ones((9, 2)), ("b", 0): np.zeros((9, 2)), ("c", 0): bad})
    assert [*load(file, "x")] == [("a b", -2)]
    assert load(file, "y") == {}
