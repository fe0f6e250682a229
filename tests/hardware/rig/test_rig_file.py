import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.rig.rig_file import load_rig
from motiondeck_base.errors import FileFormatError

JOINT = (
    '{ name = "neck", id = 1, model = "XM430-W350", direction = 1, zero = 2048, lower = -1, upper = 1, velocity = 4 }'
)
GOOD = f'port = "/dev/ttyUSB0"\nbaud = 1_000_000\nrate_hz = 100\njoints = [\n  {JOINT},\n]\n'


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "rig.toml"
        path.write_text(text) if isinstance(text, str) else path.write_bytes(text)
        return path

    return write


def test_servo20_is_twenty_joints_in_the_robots_order(servo20_file):
    rig = load_rig(servo20_file)
    assert len(rig.joints) == 20
    assert [joint.id for joint in rig.joints] == list(range(1, 21))
    assert rig.names[:5] == ("head_pan", "head_tilt", "r_shoulder_pitch", "r_shoulder_roll", "r_elbow")
    assert rig.names[-1] == "l_ankle_roll"
    assert (rig.baud, rig.rate_hz, rig.watchdog_ms) == (4_000_000, 100, 200)


def test_an_angle_becomes_pulses(written):
    joint = load_rig(written(GOOD)).joints[0]
    assert joint.pulses(0.0) == 2048
    assert joint.pulses(0.5) == pytest.approx(2048 + 0.5 * 4096 / (2 * 3.141592653589793))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            ("rate_hz", "rate"),
            "unknown key 'rate'. Did you mean 'rate_hz'? Allowed are: baud, board, follow, gaze, groups, joints",
        ),
        (("zero", "zer0"), "unknown key 'zer0' in [joints.1]. Did you mean 'zero'? Allowed are: acceleration, "),
        (('"/dev/ttyUSB0"', "5"), "expected text, not a whole number in [port]"),
        (('"/dev/ttyUSB0"', '""'), "expected text with a length of at least 1 in [port]"),
        (("1_000_000", "1234"), "baud 1234 is not one of 9600,"),
        (("id = 1", "id = 253"), "expected a whole number of at most 252 in [joints.1.id]"),
        (("velocity = 4", "velocity = 4, lag = 0.7"), "expected a number of at most 0.5 in [joints.1.lag]"),
        (("velocity = 4", "velocity = 4, friction = -0.1"), "expected a number of at least 0 in [joints.1.friction]"),
        (("direction = 1", "direction = 2"), "2 is none of -1, 1 in [joints.1.direction]"),
        (("XM430-W350", "MX-28 1.0"), "joints.1: model 'MX-28 1.0' is unknown. Did you mean MX-28(1.0)"),
        (("-W350", "-X"), "joints.1: model 'XM430-X' is unknown"),
        (("XM430-W350", "QDD-100"), "joints.1: model 'QDD-100' is unknown. motiondeck rig scan names the servos on"),
        (
            ("XM430-W350", "RH-P12-RN"),
            "model 'RH-P12-RN' cannot be a joint of a rig: its motor and",
        ),
        (
            ("velocity = 4", "velocity = 0.02"),
            "velocity is 0.02 rad/s; the least that 'XM430-W350' can keep is 0.024",
        ),
        (
            ("velocity = 4", "velocity = 4, acceleration = 0.1"),
            "acceleration is 0.1 rad/s^2; the least that 'XM430-W350' can keep is 0.375",
        ),
        (
            ("velocity = 4", "velocity = 4, current = 0.002"),
            "current is 0.002 A; the least that 'XM430-W350' can keep is 0.00269",
        ),
        (("lower = -1", "lower = 2"), "joints.1: lower is 2.0 rad and upper 1.0 rad; lower must be below"),
        (("upper = 1", "upper = nan"), "joints.1.upper is nan; it must be a finite number"),
        (("velocity = 4", "velocity = inf"), "joints.1.velocity is inf; it must be a finite number"),
        (("upper = 1", "upper = 90"), "are beyond two turns of the joint: give radians"),
        (
            ('"XM430-W350", direction = 1, zero = 2048', '"AX-12A", direction = 1, zero = 100'),
            "reach from -95 to 295 pulses, outside the servo's one turn (0 to 1023), and model 'AX-12A' counts no",
        ),
        (("rate_hz = 100", "rate_hz = 4"), "watchdog_ms 200 is too short for rate_hz 4: the servos would stop"),
        (("rate_hz = 100", "rate_hz = 100\nwatchdog_ms = 34"), "It must be at least 35"),
        (('"neck"', '""'), "joints.1: name '' must be printable, and not empty"),
        (('"neck"', '"a\\u001b[31m"'), "must be printable"),
        (
            ("velocity = 4", "velocity = 4, current = 9"),
            "current is 9 A; the most that model 'XM430-W350' takes is 3.21 A",
        ),
        (("velocity = 4", "velocity = 0"), "expected a number above 0 in [joints.1.velocity]"),
        ((f"  {JOINT},\n", f"  {JOINT},\n  {JOINT.replace('neck', 'nose')},\n"), "id 1 is used more than once"),
        (
            (f"  {JOINT},\n", f"  {JOINT},\n  {JOINT.replace('id = 1', 'id = 2')},\n"),
            "name neck is used more than once",
        ),
        ((f"  {JOINT},\n", ""), "expected a list with a length of at least 1 in [joints]"),
        (("baud = 1_000_000\n", ""), "missing key 'baud'"),
    ],
)
def test_a_mistake_is_named_with_its_place_and_what_is_allowed(written, change, said):
    path = written(GOOD.replace(*change))
    with pytest.raises(FileFormatError, match=re.escape(said)) as caught:
        load_rig(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_editors_write_before_the_text_is_no_mistake(written):
    path = written("\ufeff" + GOOD.replace("\n", "\r\n"))
    assert load_rig(path).names == ("neck",)


@pytest.mark.parametrize("alphabet", ["utf-16", "latin-1"])
def test_another_alphabet_is_named(tmp_path, alphabet):
    path = tmp_path / "rig.toml"
    path.write_text(f"{GOOD}# Größe\n", encoding=alphabet)
    with pytest.raises(FileFormatError, match=r"rig\.toml: not a text file in UTF-8; save it as UTF-8"):
        load_rig(path)


LINES = f"""# a comment with joints = [ {{
port = "/dev/tty # not a comment {{"
baud = 1_000_000
rate_hz = 100
joints = [
  {JOINT}, {JOINT.replace("neck", "nose").replace("id = 1", "id = 2")},
  {JOINT.replace("neck", "jaw").replace("id = 1", "id = 3")},
]
on_exit = "off"
"""
TABLES = """rate_hz = 100
port = "/dev/ttyUSB0"
baud = 1_000_000

[[joints]]
name = "neck"
id = 1
model = "XM430-W350"
direction = 1
zero = 2048
lower = -1
upper = 1
velocity = 4
"""


@pytest.mark.parametrize(
    ("text", "change", "line"),
    [
        (LINES, ("baud = 1_000_000", "baud = 1234"), 3),
        (LINES, ("rate_hz = 100", "rate_hz = 0"), 4),
        (LINES, ("rate_hz = 100", "rote_hz = 100"), 4),
        (LINES, ('on_exit = "off"', 'on_exit = "of"'), 9),
        (LINES, ("id = 2", "id = 300"), 6),
        (LINES, ("id = 3", "id = 2"), 7),
        (LINES, ('"jaw"', "7"), 7),
        (LINES, ('"jaw"', "jaw"), 7),
        (TABLES, ("upper = 1", "upper = 90"), 5),
        (TABLES, ("id = 1", 'id = "x"'), 7),
        (TABLES, ("rate_hz", "rate"), 1),
    ],
)
def test_the_line_of_a_mistake_is_named(written, text, change, line):
    path = written(text.replace(*change))
    with pytest.raises(FileFormatError, match=rf"line {line}\b"):
        load_rig(path)


@pytest.mark.parametrize("length", [20, len(GOOD) - 4, 100])
def test_a_truncated_file_is_refused(written, length):
    with pytest.raises(FileFormatError, match=r"rig\.toml"):
        load_rig(written(GOOD[:length]))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileFormatError, match=r"nowhere\.toml: cannot be read"):
        load_rig(tmp_path / "nowhere.toml")


@given(st.binary(max_size=200), st.integers(0, len(GOOD)))
def test_mangled_bytes_end_in_one_clear_error_or_a_rig(tmp_path_factory, junk, at):
    path = tmp_path_factory.mktemp("mangled") / "rig.toml"
    good = GOOD.encode()
    path.write_bytes(good[:at] + junk + good[at + len(junk) :])
    try:
        said = repr(load_rig(path))
    except FileFormatError as error:
        said = str(error)
    assert "neck" in said or str(path) in said
