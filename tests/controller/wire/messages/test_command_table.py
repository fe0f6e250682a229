"""The command table: complete, and the same limits for typed commands and for those on the wire."""

import re

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.wire import run_recording
from controller.wire.messages.arguments import Choice, Flag, FurtherParts, Number, Text
from controller.wire.messages.command_table import BY_WORD, COMMANDS, WholeCommand, parse_command, read_command, row_of
from controller.wire.messages.commands import Blend, CommandError, DeckCommand, EmergencyStop, Pause, Reset, encode
from motiondeck.run.terminal import HELP

NAMES = st.text("abc-1", min_size=1, max_size=100).filter(lambda name: name not in BY_WORD)


def test_every_message_has_one_row_and_its_tag_is_the_word():
    assert {command.message for command in COMMANDS} == set(DeckCommand.__subclasses__())
    assert all(command.message.__struct_config__.tag == command.word for command in COMMANDS)
    assert set(run_recording.COMMANDS) <= set(BY_WORD)


def test_the_help_has_a_line_for_each_command():
    lines = [" ".join(line.split()) for line in HELP.splitlines()]
    assert all(f"{command.usage} {command.help}" in lines for command in COMMANDS)


def typed(argument):
    if isinstance(argument, Text):
        return NAMES
    if isinstance(argument, Flag):
        return st.just(argument.name)
    if isinstance(argument, Choice):
        return st.sampled_from(argument.words)
    if isinstance(argument, WholeCommand):
        return st.sampled_from(["pause", "tempo 1.5 2", "switch jog", "jog", "lock beat 0.5 4"])
    if argument.whole:
        return st.integers(argument.lowest, argument.highest).map(str)
    return st.floats(argument.lowest, argument.highest).map(repr)


@given(st.data())
def test_every_command_in_its_ranges_is_read_alike_typed_and_from_the_wire(data):
    command = data.draw(st.sampled_from(COMMANDS))
    count = data.draw(st.integers(sum(not a.optional for a in command.arguments), len(command.arguments)))
    words = [data.draw(typed(one)) for one in command.arguments[:count] if not isinstance(one, FurtherParts)]
    if command.word == "blend":
        names = data.draw(st.lists(NAMES, min_size=2, max_size=4, unique=True))
        parts = [data.draw(st.floats(0.0, 1.0 / 3.0).map(repr)) for _ in names[1:]]
        words = [names[0], *(word for part in zip(names[1:], parts, strict=True) for word in part)]
    message = parse_command([command.word, *words])
    assert row_of(message) is command
    assert read_command(encode(message)) == message


@pytest.mark.parametrize(
    ("typed", "why"),
    [
        ("blend a b 0.5 a 0.2", "two motions or more, not a twice"),
        ("blend a b 0.5 c", "give each motion with its WEIGHT, at most 2 more"),
        ("blend a b 0.1 c 0.1 d 0.1 e 0.1", "at most 2 more of them"),
        ("blend a b 0.6 c 0.6", "sum to at most 1, not to 1.2; a has what is left"),
        ("blend a b 1.2 c 0.1", "WEIGHT must be a number from 0 to 1, not 1.2"),
        ("blend a b 0.5 c -0.1", "WEIGHT must be a number from 0 to 1, not -0.1"),
    ],
)
def test_what_is_no_blend_is_refused_and_says_what_is(typed, why):
    with pytest.raises(CommandError, match=re.escape(why)):
        parse_command(typed.split())


def test_a_blend_of_several_is_typed_as_motions_with_their_weights():
    message = parse_command(["blend", "walk", "slow-walk", "0.3", "jog", "0.2"])
    assert message == Blend("walk", "slow-walk", 0.3, also=(("jog", 0.2),))
    assert message.motions == ("walk", "slow-walk", "jog")
    assert read_command(b'{"type":"blend","first":"a","second":"b","share":0.4}') == Blend("a", "b", 0.4)


def required(command):
    """Values for the arguments that a command must have."""
    examples = {
        Text: lambda a: a.name,
        Number: lambda a: a.lowest,
        Choice: lambda a: a.words[0],
        WholeCommand: lambda a: Pause(),
    }
    return {a.field: examples[type(a)](a) for a in command.arguments if not a.optional}


@pytest.mark.parametrize("argument", [a for c in COMMANDS for a in c.arguments if isinstance(a, Number)])
@given(st.data())
def test_a_number_out_of_range_is_refused_typed_and_on_the_wire(argument, data):
    (command,) = (c for c in COMMANDS if argument in c.arguments)
    outside = st.one_of(
        st.floats(max_value=argument.lowest, exclude_max=True),
        st.floats(min_value=argument.highest, exclude_min=True),
        st.just(float("nan")),
    )
    value = data.draw(outside)
    message = command.message(**(required(command) | {argument.field: value}))
    lowest = re.escape(f"{argument.lowest:g}")
    with pytest.raises(CommandError, match=f"{argument.name} must be a (whole )?number from {lowest} to"):
        argument.check(value)
    with pytest.raises(CommandError):  # JSON has no NaN: there it is not a number at all
        read_command(encode(message))


def test_the_blend_weight_keeps_its_name_on_the_wire():
    assert msgspec.json.decode(encode(parse_command(["blend", "a", "b", "0.25"])))["share"] == 0.25


def test_the_emergency_stop_is_always_allowed_and_its_reset_only_while_it_is_on():
    assert "emergency stop" in row_of(EmergencyStop()).modes
    assert "playing" in row_of(EmergencyStop()).modes
    assert row_of(Reset()).modes == {"emergency stop"}
    moving = [c.word for c in COMMANDS if "emergency stop" not in c.modes]
    plays = ["switch", "queue", "blend", "tempo", "input", "jump", "beat", "lock", "unlock"]
    assert moving == [*plays, "pause", "step", "resume", "home", "at", "restart", "scan", "load"]


@pytest.mark.parametrize("words", [["switch", "\udcff"], ["load", "\udcff.safetensors", "walk"]])
def test_bytes_that_are_no_text_are_refused_before_they_are_sent(words):
    """As a terminal of another alphabet gives them."""
    with pytest.raises(CommandError, match=r"text in UTF-8, not '.*udcff"):
        parse_command(words)
