"""Settings of servos in a file: an earlier backup stays."""

import pytest

from command_line import invoked
from motiondeck_base.errors import MotiondeckError


def test_a_backup_never_replaces_an_earlier_one(tmp_path):
    """It may hold the settings from before `rig doctor --fix`, of which there is no other copy."""
    file = tmp_path / "servos.json"
    file.write_text("[]")
    with pytest.raises(MotiondeckError, match=r"servos\.json exists already"):
        invoked("rig", "backup", "servo20", "--out", str(file), catch_exceptions=False)
    assert file.read_text() == "[]"
    with pytest.raises(MotiondeckError, match="there is no such folder"):
        invoked("rig", "backup", "servo20", "--out", str(tmp_path / "no" / "s.json"), catch_exceptions=False)
