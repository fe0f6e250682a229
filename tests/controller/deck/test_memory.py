"""A deck keeps a bounded record of its switches, and nothing else of a command."""

import gc
import sys
from collections import deque

import numpy as np

import synthetic
from controller.deck.deck import Deck
from controller.deck.switch_plan import REMEMBERED_SWITCHES
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.stop_requests import StopRequest
from controller.wire.messages.commands import Switch


def test_commands_leave_nothing_behind_once_the_record_is_full():
    library = synthetic.small_library()
    motions = library.network.motions
    deck = Deck(library, lambda pose: np.zeros(3), motions[0])
    desk, stop = CommandHandler(CommandedRun(deck), []), StopRequest()

    def command(count):
        for number in range(count):
            desk.carry_out(Switch(motions[number % len(motions)]), stop)
            desk(stop)
            deck.update(0.005)
        gc.collect()
        return sys.getallocatedblocks()

    assert deck.switches.maxlen == REMEMBERED_SWITCHES
    deck.plan.commanded = deque(maxlen=20)  # it is full sooner
    before = command(50)
    assert (command(200) - before) / 200 < 0.5
