"""Some hundred hostile commands to a running deck, as `benchmarks hostile` sends 20,000."""

from itertools import islice

import pytest

from benchmarks.stop.hostile import DECKS, HostileCommands, running_deck, soak
from controller.wire.messages.command_table import COMMANDS
from controller.wire.messages.commands import AtTime


def test_they_are_of_every_type_but_the_one_that_ends_the_run():
    types = {type(command) for command in islice(HostileCommands(0), 100)}
    assert types == {row.message for row in COMMANDS if row.word != "stop"}
    nested = [command for command in islice(HostileCommands(0), 3000) if isinstance(command, AtTime)]
    assert any(isinstance(command.say, AtTime) for command in nested)


@pytest.mark.parametrize("deck", DECKS)
def test_a_deck_answers_each_and_stops_for_an_emergency(deck):
    with running_deck(*DECKS[deck]) as (process, client, said):
        soaked = soak(process, client, iter(HostileCommands(7)), 400, each=200)
        assert soaked.passed, (str(soaked), said.read_text()[-2000:])
    assert soaked.sent.total() == 400
    assert len(soaked.stopped_s) == 2
