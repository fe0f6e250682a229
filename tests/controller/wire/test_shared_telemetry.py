import stat
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.wire.telemetry import StateReader, StateWriter
from motiondeck_base.errors import FileFormatError

FIELDS = {"qpos": 27, "root_xy": 2, "tick": 1}
DESCRIPTION = {"model_file": "robot.xml", "motions": ["walk", "jog"], "robot": "mannequin"}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "state"


def test_what_is_published_is_read(path):
    writer = StateWriter(path, DESCRIPTION, FIELDS)
    reader = StateReader(path)
    assert reader.description == DESCRIPTION
    assert reader.read() is None
    writer.publish(qpos=np.arange(27.0), tick=5.0)
    writer.fields["root_xy"][:] = 1.5, -2.5
    writer.publish()
    state = reader.read()
    assert state is not None
    assert {name: value.tolist() for name, value in state.items()} == {
        "qpos": list(range(27)),
        "root_xy": [1.5, -2.5],
        "tick": [5.0],
    }


def test_what_was_read_stays_as_it_was(path):
    writer = StateWriter(path, DESCRIPTION, FIELDS)
    reader = StateReader(path)
    writer.publish(tick=1.0)
    state = reader.read()
    for tick in range(2, 30):
        writer.publish(tick=float(tick))
    assert state is not None
    assert state["tick"] == 1.0
    latest = reader.read()
    assert latest is not None
    assert latest["tick"] == 29.0


def test_the_file_is_its_owners_alone(path):
    StateWriter(path, DESCRIPTION, FIELDS)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert list(path.parent.iterdir()) == [path]


def test_readers_learn_that_the_writer_has_closed(path):
    writer = StateWriter(path, DESCRIPTION, FIELDS)
    reader = StateReader(path)
    writer.publish(tick=3.0)
    assert not reader.ended
    writer.close()
    writer.close()
    assert reader.ended
    state = reader.read()
    assert state is not None
    assert state["tick"] == 3.0


def test_readers_learn_that_the_writer_was_killed(path):
    program = (
        "import os, pathlib, signal, sys\n"
        "from controller.wire.telemetry import StateWriter\n"
        "StateWriter(pathlib.Path(sys.argv[1]), {}, {'x': 1}).publish(x=4.0)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", program, str(path)], check=False)
    reader = StateReader(path)
    assert reader.ended
    state = reader.read()
    assert state is not None
    assert state["x"] == 4.0


def test_a_slot_that_is_torn_is_never_shown(path):
    writer = StateWriter(path, DESCRIPTION, FIELDS)
    writer.publish(qpos=np.ones(27))
    reader = StateReader(path)
    words = writer._slots[1]
    for place in range(len(words)):
        before = words[place]
        words[place] = before ^ np.uint64(1)
        assert reader.read() is None, f"word {place}"
        words[place] = before
    assert reader.read() is not None


def test_another_process_never_sees_a_torn_state(path):
    """The writer publishes numbers that belong together as fast as it can; the reader checks each state it sees."""
    writer = StateWriter(path, {}, {"number": 1, "block": 5000, "mirror": 1})
    program = (
        "import pathlib, sys\n"
        "from controller.wire.telemetry import StateReader\n"
        "reader = StateReader(pathlib.Path(sys.argv[1]))\n"
        "print('ready', flush=True)\n"
        "seen, last = 0, -1.0\n"
        "ended = False\n"
        "while not ended:\n"
        "    ended = reader.ended\n"  # it may get no core until then, and sees the last state all the same
        "    state = reader.read()\n"
        "    if state is None: continue\n"
        "    number = state['number'][0]\n"
        "    assert (state['block'] == number).all() and state['mirror'][0] == -number, 'torn'\n"
        "    assert number >= last, 'went back'\n"
        "    seen, last = seen + (number != last), number\n"
        "print(seen)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program, str(path)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        for number in range(10_000):
            writer.publish(number=number, block=number, mirror=-number)
        writer.close()
        seen = int(process.stdout.read())
    assert process.returncode == 0
    assert seen > 0


def test_a_file_that_is_missing_is_named(path):
    with pytest.raises(FileFormatError, match=r"state: cannot be read \(No such file.*is the deck running"):
        StateReader(path)


@given(st.binary(max_size=200))
def test_an_alien_file_is_refused(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "alien"
    path.write_bytes(data)
    with pytest.raises(FileFormatError, match="alien"):
        StateReader(path)


@given(st.data())
def test_a_damaged_file_is_refused_or_says_no_more_than_it_did(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "damaged"
    writer = StateWriter(path, DESCRIPTION, FIELDS)
    writer.publish(tick=7.0)
    content = bytearray(path.read_bytes())
    if data.draw(st.booleans()):
        del content[data.draw(st.integers(0, len(content) - 1)) :]
    else:
        content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    copy = path.with_name("copy")
    copy.write_bytes(content)
    try:
        state = StateReader(copy).read()
    except FileFormatError:
        return
    assert state is None or 7.0 in [value for field in state.values() for value in field]


def test_a_header_that_claims_too_much_is_refused(path):
    header = b'{"description":{},"fields":{"x":99999999999},"writer":1}'
    path.write_bytes(b"MDTELEM1" + len(header).to_bytes(8, "little") + header + bytes(4096))
    with pytest.raises(FileFormatError, match="cut short or damaged"):
        StateReader(path)


def test_a_field_that_is_not_described_is_a_mistake(path):
    with pytest.raises(KeyError, match="speed"):
        StateWriter(path, DESCRIPTION, FIELDS).publish(speed=1.0)
