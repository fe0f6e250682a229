"""A bag of new servos is set up one after another, and goes on where it was interrupted."""

import msgspec
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import load_rig
from hardware.tools.scan import set_up_all
from motiondeck_base.errors import MotiondeckError

ROW = "direction = 1, zero = 2048, lower = -1.0, upper = 1.0, velocity = 4.0"
RIG = f"""
port = "/dev/ttyUSB0"
baud = 1000000
rate_hz = 100
joints = [
  {{ name = "pan", id = 4, model = "XL330-M288", {ROW} }},
  {{ name = "tilt", id = 5, model = "XL330-M288", {ROW} }},
  {{ name = "jaw", id = 6, model = "XL330-M077", {ROW} }},
]
"""


class Table:
    """Servos of a bag, and the port to which the last one taken is connected."""

    def __init__(self, file):
        self.config = load_rig(file)
        self.asked, self.said, self.bag, self.port = [], [], [], None

    def servo(self, model):
        joint = msgspec.structs.replace(self.config.joints[0], id=1, model=model)
        return EmulatedPort(EmulatedBus(msgspec.structs.replace(self.config, joints=(joint,), baud=57600)))

    def ask(self, prompt):
        self.asked.append(prompt)
        if not self.bag:
            raise MotiondeckError("standard input has ended")
        self.port = self.bag.pop(0)

    def open_bus(self, baud):
        self.port.bus.baud = baud
        return Bus(self.port, baud)

    def run(self, file, *bag):
        self.bag = list(bag)
        set_up_all(file, self.open_bus, self.ask, self.said.append)


def identity(port, config):
    port.bus.baud = config.baud
    return [one.id for one in Bus(port, config.baud).ping_all()]


@pytest.fixture
def file(tmp_path):
    (tmp_path / "head.toml").write_text(RIG)
    return tmp_path / "head.toml"


def test_every_servo_gets_the_id_and_baud_rate_of_the_rig_file(file):
    table = Table(file)
    bag = [table.servo("XL330-M288"), table.servo("XL330-M288"), table.servo("XL330-M077")]
    table.run(file, *bag)
    assert [identity(port, table.config) for port in bag] == [[4], [5], [6]]
    assert table.said[-1] == "jaw: id 1 at 57600 baud is now id 6 at 1000000 baud (3 of 3)"
    assert not file.with_name("head.toml.setup").exists()


def test_it_goes_on_where_it_was_interrupted(file):
    table = Table(file)
    bag = [table.servo("XL330-M288"), table.servo("XL330-M288"), table.servo("XL330-M077")]
    with pytest.raises(MotiondeckError, match="standard input has ended"):
        table.run(file, bag[0])
    assert file.with_name("head.toml.setup").read_text() == "pan\n"
    table = Table(file)
    table.run(file, *bag[1:])
    assert table.asked[0].startswith("tilt (id 5): connect a new XL330-M288 alone")
    assert [identity(port, table.config) for port in bag] == [[4], [5], [6]]


def test_a_servo_that_was_set_up_before_or_of_another_model_is_not_changed(file):
    table = Table(file)
    first, second, third = table.servo("XL330-M288"), table.servo("XL330-M288"), table.servo("XL330-M077")
    table.run(file, first, first, third, second, third)
    assert "this is the servo of pan, set up before. Connect the next one." in table.said[1]
    assert "a XL330-M077 answers, but tilt (id 5) is a XL330-M288" in table.said[2]
    assert [identity(port, table.config) for port in (first, second, third)] == [[4], [5], [6]]
