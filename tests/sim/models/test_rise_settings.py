import pytest

from motiondeck_base.errors import FileFormatError
from sim.models.robot_file import read_robot_file
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human

FILE = ROBOTS / "servo20.toml"


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("[0.0, 0.1, 0.1, 0.1, 0.1, 0.1]", r"rise\.back, row 1: .*a time above 0 s"),
        ("[1.0, nan, 0.1, 0.1, 0.1, 0.1]", r"rise\.back\.1\.2 is nan; it must be a finite number"),
        ("[1.0, 0.1]", "rise.back"),
    ],
)
def test_a_row_that_is_no_posture_is_refused_by_name(tmp_path, row, complaint):
    path = tmp_path / "robot.toml"
    text = FILE.read_text()
    path.write_text(text[: text.index("back = [")] + f"back = [{row}]\n")
    with pytest.raises(FileFormatError, match=complaint):
        read_robot_file(path)


def test_who_turns_onto_its_belly_must_get_up_from_there(tmp_path):
    path = tmp_path / "robot.toml"
    text = FILE.read_text()
    path.write_text(text[: text.index("front = [")] + text[text.index("back = [") :])
    with pytest.raises(FileFormatError, match=r"rise\.back .*needs rise\.front"):
        read_robot_file(path)


def test_a_robot_gets_up_by_the_postures_of_its_file():
    robot, table = load_robot(FILE, human()), read_robot_file(FILE).rise
    assert robot.rise is not None
    for rows, postures in ((table.front, robot.rise.front), (table.back, robot.rise.back)):
        assert [seconds for seconds, _ in postures] == [row[0] for row in rows]
        for row, (_, joints) in zip(rows, postures, strict=True):
            named = dict(zip(robot.joints, joints, strict=True))
            assert [named["l_knee"], named["r_elbow"]] == pytest.approx([row[2], row[5]], abs=0.02)
            assert named["l_hip_pitch"] == pytest.approx(max(-row[1], -2.2), abs=0.02)


def test_a_robot_without_them_cannot_get_up(tmp_path):
    text = (ROBOTS / "mannequin.toml").read_text()
    assert "[rise]" not in text
    assert load_robot(ROBOTS / "mannequin.toml", human()).rise is None
