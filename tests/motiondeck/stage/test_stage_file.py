import re

import pytest

from controller.wire.messages.arguments import CommandError
from controller.wire.messages.commands import Blend, LockPhase, SetInput, SetTempo, Switch
from motiondeck.stage.command_pattern import CommandPattern
from motiondeck.stage.stage_file import read_stage
from motiondeck.stage.timecode import Timecode
from motiondeck_base.errors import FileFormatError
from motiondeck_base.shipped import find_stage, shipped_configs


def written(folder, text):
    file = folder / "show.toml"
    file.write_text(text)
    return file


def test_the_shipped_files_are_read_and_name_motions_of_thesis15():
    files = sorted((shipped_configs() / "stages").glob("*.toml"))
    assert [file.stem for file in files] == ["midi", "osc"]
    for file in files:
        named = {motion for pattern in read_stage(find_stage(file.stem)).patterns for motion in pattern.motions}
        assert named == {"walk", "jog", "waltz"}


def test_a_file_maps_addresses_notes_and_times(tmp_path):
    stage = read_stage(
        written(
            tmp_path,
            '[osc]\nlisten = 9000\nsend_to = "desk:9001"\n[osc.commands]\n"/a" = "tempo $1"\n'
            '[midi]\ninput = "Desk"\nchannel = 10\nclock = true\n[midi.notes]\n36 = "walk"\n'
            '[midi.controls]\n1 = "input jaw $1 60"\n'
            '[midi.timecode]\n"01:02:03:04" = "blend walk jog 0.5"\n',
        )
    )
    assert (stage.osc.port, stage.osc.target) == (9000, ("desk", 9001))
    assert stage.osc.commands["/a"].command([0.5]) == SetTempo(0.5)
    assert (stage.midi.input, stage.midi.channel, stage.midi.clock) == ("Desk", 9, True)
    assert stage.midi.notes[36].command() == Switch("walk")
    assert stage.midi.controls[1].command([0.5]) == SetInput("jaw", 0.5, 60.0)
    assert stage.midi.cues[Timecode(1, 2, 3, 4)].command() == Blend("walk", "jog", 0.5)
    assert [motion for pattern in stage.patterns for motion in pattern.motions] == ["walk", "walk", "jog"]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "nothing is mapped"),
        ("[osc]\nlisten = 0", "expected a whole number of at least 1"),
        ('[osc]\nsend_to = "9001"', "send_to in [osc] is HOST:PORT"),
        ('[osc.commands]\n"/a" = "stop"', "commands in [osc] need a port"),
        ('[osc]\nlisten = 9\n[osc.commands]\n"a" = "stop"', "'a' in [osc.commands]: an OSC address begins with /"),
        (
            '[osc]\nlisten = 9\n[osc.commands]\n"/a" = "dance now"',
            "'/a' in [osc.commands]: 'dance now' is not a command",
        ),
        ('[osc]\nlisten = 9\n[osc.commands]\n"/a" = "$1"', "does not begin with a command"),
        ('[osc]\nlisten = 9\n[osc.commands]\n"/a" = "tempo $1 $2 $3"', "give it as: tempo TEMPO [SECONDS]"),
        ('[midi]\ninput = "a"\n[midi.notes]\nC3 = "stop"', "a note is a number from 0 to 127"),
        ('[midi]\ninput = "a"\n[midi.notes]\n36 = "tempo $1"', "only OSC messages and controls have arguments"),
        ('[midi]\ninput = "a"\n[midi.controls]\n120 = "tempo $1"', "a controller is a number from 0 to 119"),
        ('[midi]\ninput = "a"\n[midi.controls]\n1 = "jump $2"', "jump: PHASE must be a number from 0 to 1, not -1"),
        ('[midi]\ninput = "a"\n[midi.controls]\n1 = "lock beat 0 $1"', "STEPS must be a whole number"),
        ('[midi]\ninput = "a"\n[midi.controls]\n1 = "tempo $3"', "argument 3 is missing"),
        ('[midi]\ninput = "a"\n[midi.timecode]\n"1:2:3" = "stop"', "'1:2:3' in [midi.timecode]: a time of a timecode"),
        ('[midi]\ninput = "a"\n[midi.timecode]\n"00:61:00:00" = "stop"', "a time of a timecode is HH:MM:SS:FF"),
        ('[midi]\ninput = "a"\nchannels = 3', "unknown key 'channels' in [midi]. Did you mean 'channel'?"),
    ],
)
def test_a_mistake_is_named_with_file_and_place(tmp_path, text, problem):
    file = written(tmp_path, text)
    with pytest.raises(FileFormatError) as caught:
        read_stage(file)
    (line,) = str(caught.value).splitlines()
    assert re.match(rf"{re.escape(str(file))}( line \d+)?: ", line)
    assert problem in line


def test_whole_numbers_come_as_floats_too():
    assert CommandPattern("lock beat $2 $1").command([2.0, 0.25]) == LockPhase("beat", phase=0.25, steps=2)
    with pytest.raises(CommandError, match="argument 2 is missing"):
        CommandPattern("lock beat $2 $1").command([2.0])


def test_0_is_an_argument_where_one_is_asked_for():
    assert CommandPattern("tempo $1").command([0.0]) == SetTempo(0.0)


@pytest.mark.parametrize("arguments", [[0], [0.0], [False]])
def test_a_released_button_gives_no_command(arguments):
    assert CommandPattern("jog").command(arguments) is None
    for pressed in ([], [1], [True], [0, 0], ["off"]):
        assert CommandPattern("jog").command(pressed) == Switch("jog")
