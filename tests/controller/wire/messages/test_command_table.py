"""The rows of commands: complete, and the same limits for typed commands and for those on the wire."""

import re
import runpy
from pathlib import Path
from typing import get_args

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from command_strategies import typed_argument
from controller.wire.messages.arguments import CommandError, Number
from controller.wire.messages.command_row import CommandMessage
from controller.wire.messages.command_table import BY_WORD, COMMANDS, RECORDED, parse_command, read_command
from controller.wire.messages.commands import AtTime, Blend, DeckCommand, EmergencyStop, Reset, Switch, encode
from motiondeck.run.terminal import HELP

NAMES = st.text("abc-1", min_size=1, max_size=100).filter(lambda name: name not in BY_WORD)
DECK_PAGE = Path(__file__).parents[4] / "docs" / "deck.md"


def test_every_message_is_a_command_with_a_row_and_a_word():
    assert set(get_args(DeckCommand)) == set(CommandMessage.__subclasses__())
    assert [row.message for row in COMMANDS] == list(get_args(DeckCommand))
    assert len(BY_WORD) == sum(1 + len(row.aliases) for row in COMMANDS)
    assert all(row.help.endswith(".") for row in COMMANDS)


def test_numbers_in_recordings_stay_what_they_are():
    """Recordings are read for years: a number once given never means another command."""
    first = (
        "switch queue tempo pause resume home estop reset stop blend jump input beat lock unlock torque restart load"
    )
    words = [*first.split(), "push", "write", "scan", "step"]
    assert [RECORDED[number] for number in range(1, len(words) + 1)] == words
    assert len(RECORDED) == sum(row.record > 0 for row in COMMANDS)


@pytest.mark.parametrize(
    ("use", "words"),
    [
        ("timed", "switch queue blend tempo input jump lock unlock pause resume home push stop"),
        ("cue", "switch queue blend tempo input jump unlock pause resume home push stop"),
        ("film", "switch queue blend tempo jump pause resume"),
    ],
)
def test_a_command_is_taken_where_its_row_says_so(use, words):
    taken = {row.word for row in COMMANDS if use in row.uses}
    assert taken >= set(words.split())
    assert not taken & {"estop", "reset", "torque", "write", "load", "at", "beat", "step"}
    with pytest.raises(CommandError, match=r"'estop' is not for .*, which takes: switch, queue, blend"):
        EmergencyStop.row.check_use(use)


def test_a_script_takes_no_other_time_and_a_replay_nothing_that_a_network_plays():
    assert "script" not in BY_WORD["at"].uses
    steered = {"switch", "queue", "blend", "input", "jump", "beat", "lock", "unlock"}
    assert not {row.word for row in COMMANDS if "replay" in row.uses} & steered
    assert {"tempo", "pause", "resume", "estop", "reset", "stop"} <= {r.word for r in COMMANDS if "replay" in r.uses}


def test_only_a_command_for_a_later_time_goes_into_at():
    assert parse_command(["at", "5", "switch jog"]) == AtTime(5.0, Switch("jog"))
    for inner in ("estop", "at 5 pause", "tempo 9"):
        with pytest.raises(CommandError):
            parse_command(["at", "5", inner])
    for inner in ('"estop"', '"at","when":5,"say":{"type":"pause"}', '"tempo","factor":9'):
        with pytest.raises(CommandError):
            read_command(f'{{"type":"at","when":5,"say":{{"type":{inner}}}}}'.encode())


def test_the_help_has_a_line_for_each_command():
    lines = [" ".join(line.split()) for line in HELP.splitlines()]
    assert all(f"{command.usage} {command.help}" in lines for command in COMMANDS)


def test_the_page_of_the_deck_has_the_table_of_the_rows():
    """Made anew with: python docs/deck_commands.py"""
    assert runpy.run_path(str(DECK_PAGE.with_name("deck_commands.py")))["with_table"](DECK_PAGE.read_text()) == (
        DECK_PAGE.read_text()
    )


@given(st.data())
def test_every_command_in_its_ranges_is_read_alike_typed_and_from_the_wire(data):
    row = data.draw(st.sampled_from(COMMANDS))
    required = sum(not one.optional for one in row.arguments)
    count = data.draw(st.integers(required, len(row.arguments)))
    words = [data.draw(typed_argument(one.argument)) for one in row.arguments[:count]]
    if row.word == "blend":
        names = data.draw(st.lists(NAMES, min_size=2, max_size=4, unique=True))
        parts = [data.draw(st.floats(0.0, 1.0 / 3.0).map(repr)) for _ in names[1:]]
        words = [names[0], *(word for part in zip(names[1:], parts, strict=True) for word in part)]
    message = parse_command([row.word, *words])
    assert message.row is row
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


@pytest.mark.parametrize(
    ("row", "number"),
    [(row, one) for row in COMMANDS for one in row.arguments if isinstance(one.argument, Number)],
    ids=lambda case: getattr(case, "word", None) or case.field,
)
@given(st.data())
def test_a_number_out_of_range_is_refused_typed_and_on_the_wire(row, number, data):
    lowest, highest = number.argument.lowest, number.argument.highest
    value = data.draw(
        st.one_of(
            st.floats(max_value=lowest, exclude_max=True),
            st.floats(min_value=highest, exclude_min=True),
            st.just(float("nan")),
        )
    )
    before = row.arguments[: row.arguments.index(number)]
    after = [one for one in row.arguments[len(before) + 1 :] if not one.optional]
    words = [[data.draw(typed_argument(one.argument)) for one in part] for part in (before, after)]
    expected = rf"{number.argument.name} must be a (whole )?number from {re.escape(f'{lowest:g}')} to"
    with pytest.raises(CommandError, match=expected):
        parse_command([row.word, *words[0], repr(value), *words[1]])
    with pytest.raises(CommandError):
        read_command(b'{"type":"%b","%b":%b}' % (row.word.encode(), number.field.encode(), repr(value).encode()))


def test_the_blend_weight_keeps_its_name_on_the_wire():
    assert msgspec.json.decode(encode(parse_command(["blend", "a", "b", "0.25"])))["share"] == 0.25


def test_the_emergency_stop_is_always_allowed_and_its_reset_only_while_it_is_on():
    assert "emergency stop" in EmergencyStop.row.modes
    assert "playing" in EmergencyStop.row.modes
    assert Reset.row.modes == {"emergency stop"}
    moving = {row.word for row in COMMANDS if "emergency stop" not in row.modes}
    plays = ["switch", "queue", "blend", "tempo", "input", "jump", "beat", "lock", "unlock"]
    assert moving >= {*plays, "pause", "step", "resume", "home", "at", "restart", "scan", "load"}


@pytest.mark.parametrize("words", [["switch", "\udcff"], ["load", "\udcff.safetensors", "walk"]])
def test_bytes_that_are_no_text_are_refused_before_they_are_sent(words):
    """As a terminal of another alphabet gives them."""
    with pytest.raises(CommandError, match=r"text in UTF-8, not '.*udcff"):
        parse_command(words)
