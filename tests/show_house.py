"""A show in one process on a clock of its own: members with their decks' commands, a conductor, links to be cut."""

from contextlib import ExitStack, closing
from fnmatch import fnmatch
from functools import cache

import synthetic
from controller.deck.deck import Deck
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.stop_requests import StopRequest
from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.messages.commands import EmergencyStop, GetPhase, Reset, Resume
from controller.wire.messages.replies import Accepted, PhaseNow
from motiondeck.shows.conductor import Conductor
from motiondeck.shows.member import Member
from motiondeck.shows.messages import About
from motiondeck.shows.show_file import Show

NAMES = ["left", "middle", "right"]
TICK = 0.02
SETTLES = 0.7  # s; questions are at most 0.35 s apart

library = cache(synthetic.small_phase_library)


class Network:
    """Links in this process: any can be cut, two be `apart`, and in a pair of `deaf` the first not hear the second."""

    def __init__(self):
        self.links, self.apart, self.deaf = {}, [], []

    def others(self, name):
        here = self.links[name]
        linked = [link for link in self.links.values() if link is not here and not here.cut and not link.cut]
        return [link for link in linked if {name, link.name} not in self.apart and (link.name, name) not in self.deaf]


class Link:
    def __init__(self, network, name, *, cut=False):
        self.network, self.name, self.cut = network, name, cut
        self.subscribed, self.answers, self.announced, self.watching = [], {}, [], []
        network.links[name] = self

    def subscribe(self, keys, received):
        self.subscribed.append((keys, received))

    def publish(self, key, data):
        for link in self.network.others(self.name):
            for keys, received in link.subscribed:
                if fnmatch(key, keys):
                    received(key, data)

    def answer(self, key, answer):
        self.answers[key] = answer

    def ask(self, keys, received, patience=1.0):
        for link in self.network.others(self.name):
            for key, answer in link.answers.items():
                if fnmatch(key, keys):
                    received(key, answer())

    def announce(self, key):
        self.announced.append(key)
        for link in self.network.links.values():
            for keys, seen in link.watching:
                if fnmatch(key, keys):
                    seen(key, True)

    def watch(self, keys, seen):
        self.watching.append((keys, seen))
        for link in self.network.others(self.name):
            for key in link.announced:
                if fnmatch(key, keys):
                    seen(key, True)

    def close(self):
        if self.network.links.get(self.name) is self:
            del self.network.links[self.name]


class Memory:
    """What a deck remembers on its machine."""

    def __init__(self):
        self.stops = []

    def read(self):
        return self.stops

    def write(self, stops):
        self.stops = stops


class DeckOfShow:
    """A deck with its sockets and its member."""

    def __init__(self, house, name, *, cut=False):
        self.open, self.ran = ExitStack(), False
        server = self.open.enter_context(closing(CommandServer(0)))
        leader = self.open.enter_context(closing(CommandServer(0)))
        deck = Deck(library(), lambda pose: pose.rotation.ravel(), "march")
        self.stop, self.handler, self.deck = StopRequest(), CommandHandler(CommandedRun(deck), [server]), deck
        client = self.open.enter_context(closing(CommandClient(server.port)))
        self.link, about = Link(house.network, name, cut=cut), About("dummy", "small", 50.0, {"march": 0.9})
        now = lambda: house.time  # noqa: E731
        self.member = Member(name, about, self.link, client, leader, house.notes.append, now, house.memories[name])
        self.open.callback(self.member.close)
        asking = self.open.enter_context(closing(CommandClient(leader.port)))
        while True:  # as `ShowMember.leader` waits
            asking.post(GetPhase())
            self.member.step(0.0)
            if isinstance(asking.receive(1.0), PhaseNow):
                break
            house.run(TICK)
        self.ran = True

    def tick(self):
        self.handler(self.stop)
        self.stop.state.rested()

    @property
    def moves(self):
        return self.stop.mode == "playing" and not self.deck.paused


class House:
    """A show on a clock of its own."""

    def __init__(self):
        self.time, self.notes, self.network = 1000.0, [], Network()
        self.decks, self.conductor, self.moved = {}, None, set()
        self.memories = {name: Memory() for name in NAMES}

    def conduct(self, **show):
        link = Link(self.network, "conductor")
        self.conductor = Conductor(Show("gala", **show), link, self.notes.append, now=lambda: self.time)

    def start(self, name, *, cut=False):
        self.kill(name)
        self.decks[name] = DeckOfShow(self, name, cut=cut)
        self.run(SETTLES)

    def kill(self, name):
        if name in self.decks:
            self.decks.pop(name).open.close()

    def run(self, seconds=SETTLES):
        """Runs the show; `moved` are the decks that moved meanwhile."""
        self.moved = set()
        for _ in range(round(seconds / TICK)):
            self.time += TICK
            for name, deck in self.decks.items():
                deck.tick()
                self.moved |= {name} if deck.moves else set()
                deck.member.step(0.0)
            if self.conductor is not None:
                self.conductor.step()

    def press(self, name, seconds=SETTLES):
        deck = self.decks[name]
        assert isinstance(deck.handler.carry_out(EmergencyStop(), deck.stop), Accepted)
        self.run(seconds)

    def reset(self, name, seconds=SETTLES):
        deck = self.decks[name]
        if deck.stop.emergency:
            assert isinstance(deck.handler.carry_out(Reset(), deck.stop), Accepted)
        deck.handler.carry_out(Resume(), deck.stop)
        self.run(seconds)

    def cut(self, name, *, cut=True, seconds=SETTLES):
        self.decks[name].link.cut = cut
        self.run(seconds)

    @property
    def moving(self):
        return {name for name, deck in self.decks.items() if deck.moves}

    def stops(self):
        return {name: self.conductor.stop_at(self.conductor.decks[name]) for name in self.decks}

    def close(self):
        for name in [*self.decks]:
            self.kill(name)
        if self.conductor is not None:
            self.conductor.close()
