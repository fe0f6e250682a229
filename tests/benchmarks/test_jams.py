"""Jams of servos with a limit of current: what the judge of their true current notices."""

import pytest

from benchmarks.rig.jams import PAGES, WAYS, jam
from hardware.families.models import MODELS, TRAITS
from hardware.rig.rig_file import RigJoint
from hardware.rig.switching import audit


@pytest.mark.parametrize("model", ["XM430-W350", pytest.param("PH42-020-S300", marks=pytest.mark.thorough)])
def test_a_jammed_joint_keeps_its_limit_of_current(model):
    found = jam(model)
    assert not found.wrong
    assert (found.above, found.stopped, found.yielded) == (0.0, "", True)
    assert 0.9 < found.at_first < 1.01


@pytest.mark.thorough
@pytest.mark.parametrize("across", [False, True])
@pytest.mark.parametrize("model", PAGES)
def test_every_model_keeps_its_limit_in_each_mode(model, across):
    assert not jam(model, across).wrong


def test_every_model_that_takes_a_limit_is_jammed():
    assert set(PAGES) == {model for model in TRAITS if "current_limit" in MODELS[model].registers}


def test_a_servo_in_a_mode_without_a_limit_is_noticed(monkeypatch):
    monkeypatch.setattr(RigJoint, "mode", 3)
    found = jam("XM430-W350", ways=WAYS[:1])
    assert found.wrong
    assert found.above > 0.1
    assert found.later > 2.0


def test_a_wrong_unit_of_current_is_noticed(monkeypatch):
    """Both the driver and the emulator would have it from the same table."""
    page = PAGES["XH430-V350"]
    monkeypatch.setitem(PAGES, "XH430-V350", page._replace(count=2.69e-3))
    assert jam("XH430-V350", ways=WAYS[:1]).later == pytest.approx(2.69 / 1.34, rel=0.02)


def test_twice_the_limit_is_noticed(monkeypatch):
    counts = audit.current_counts
    monkeypatch.setattr(audit, "current_counts", lambda joint: 2 * counts(joint))
    assert jam("XL330-M288", ways=WAYS[:1]).later == pytest.approx(2.0, rel=0.02)
