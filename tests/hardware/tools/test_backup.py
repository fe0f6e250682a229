"""Control tables in a file and back, against emulated servos."""

import pytest

from hardware.errors import MotiondeckError, RigError
from hardware.families.models import MODELS
from hardware.tools.backup import back_up, load_backups, restore, save_backups


def test_what_was_changed_is_restored_from_the_file(rig_of_four, bus, port, tmp_path):
    port.bus[2]["homing_offset"] = -300
    save_backups(back_up(rig_of_four, bus), tmp_path / "servos.json")
    backups = load_backups(tmp_path / "servos.json")
    assert [len(backup.registers) for backup in backups] == [len(MODELS["XM430-W350"].registers)] * 4
    port.bus[2]["homing_offset"] = 0
    port.bus[3]["drive_mode"] = 4
    assert restore(rig_of_four, backups, bus) == [
        "joint_2 (id 2): homing_offset was 0 and is -300",
        "joint_3 (id 3): drive_mode was 4 and is 0",
    ]
    assert (port.bus[2]["homing_offset"], port.bus[3]["drive_mode"]) == (-300, 0)
    assert restore(rig_of_four, backups, bus) == []


@pytest.mark.parametrize("level", [0, 1])
def test_a_servo_that_answers_no_read_is_kept_too_and_stays_as_it_is(rig_of_four, bus, port, level):
    port.bus[2]["homing_offset"], port.bus[2]["status_return_level"] = -300, level
    backup = back_up(rig_of_four, bus)[1]
    assert (backup.registers["homing_offset"], backup.registers["status_return_level"]) == (-300, level)
    assert port.bus[2]["status_return_level"] == level


def test_nothing_is_written_while_one_servo_has_its_torque_on(rig_of_four, bus, port):
    backups = back_up(rig_of_four, bus)
    port.bus[1]["drive_mode"] = 4
    port.bus[4]["torque_enable"] = 1
    with pytest.raises(RigError, match=r"joint_4 \(id 4\) has its torque on"):
        restore(rig_of_four, backups, bus)
    assert port.bus[1]["drive_mode"] == 4


def test_another_servo_in_its_place_is_not_written_to(rig_of_four, bus, port):
    backups = back_up(rig_of_four, bus)
    port.bus[2]["model_number"] = 1060
    with pytest.raises(RigError, match=r"joint_2 \(id 2\) answers as XL430-W250, not as XM430-W350"):
        restore(rig_of_four, backups, bus)
    port.bus[1].dead = True
    with pytest.raises(RigError, match=r"no answer on emulated .* from joint_1 \(id 1\)"):
        back_up(rig_of_four, bus)


@pytest.mark.parametrize(
    ("register", "value", "said"),
    [
        ("homing_ofset", 0, r"joint_3 \(id 3\) has a register 'homing_ofset', which a XM430-W350 has not"),
        ("shutdown", 999, r"joint_3 \(id 3\) cannot be restored: shutdown takes 0 to 63, not 999"),
    ],
)
def test_a_backup_with_what_no_servo_can_take_is_refused_and_nothing_written(
    rig_of_four, bus, port, register, value, said
):
    backups = back_up(rig_of_four, bus)
    backups[2].registers[register] = value
    port.bus[1]["drive_mode"] = 4
    with pytest.raises(RigError, match=said):
        restore(rig_of_four, backups, bus)
    assert port.bus[1]["drive_mode"] == 4


def test_a_joint_that_is_not_in_the_backup_is_named(rig_of_four, bus, port):
    """A rig file whose joints have other names would otherwise restore nothing and say that nothing differs."""
    backups = back_up(rig_of_four, bus)
    port.bus[1]["drive_mode"] = 4
    said = restore(rig_of_four, backups[:1], bus)
    assert said == [f"joint_{id} (id {id}): not in the backup" for id in (2, 3, 4)] + [
        "joint_1 (id 1): drive_mode was 4 and is 0"
    ]


def test_a_file_that_is_no_backup_is_named(tmp_path):
    (tmp_path / "notes.json").write_text("[{}]")
    with pytest.raises(RigError, match=r"notes\.json is not a backup"):
        load_backups(tmp_path / "notes.json")
    with pytest.raises(RigError, match="cannot read the backup"):
        load_backups(tmp_path / "none.json")
    with pytest.raises(MotiondeckError, match="cannot be written"):
        save_backups([], tmp_path / "none" / "servos.json")
