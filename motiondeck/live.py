# pyright: strict
"""A live deck: its real-time loop runs in a child process, which is commanded from here without blocking."""

from __future__ import annotations

import contextlib
import inspect
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import IO, Any, Literal, ParamSpec

import msgspec

from controller.wire.command_socket import CommandClient, SocketError
from controller.wire.messages import commands
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.command_table import checked
from controller.wire.messages.commands import DeckCommand
from controller.wire.messages.deck_snapshot import LockState
from controller.wire.messages.replies import Accepted, Refused, Settled
from controller.wire.messages.replies import Event as DeckEvent
from controller.wire.messages.replies import State as DeckStatus
from controller.wire.run_folder import run_folder
from motiondeck.deck_commands import DeckCommands
from motiondeck.libraries import Library
from motiondeck.run.live_deck import Ended, Failed, LiveMessage, Ready, with_right_types
from motiondeck.run.spec.run_spec import RunSpec, kinds, options
from motiondeck_base.errors import MotiondeckError

__all__ = ["CommandedMotion", "DeckEvent", "DeckStatus", "LiveDeck", "LockState", "play"]

P = ParamSpec("P")

_ANSWERS_WITHIN = 5.0  # s
_CHECK_EVERY = 1.0  # s
_ENDS_WITHIN = 30.0  # s: on the way to rest a rig may take its time
_MOST_AT_ONCE = 32  # commands of all threads that await their reply; a deck takes bursts of 40

_news = msgspec.json.Decoder(LiveMessage)


@dataclass(frozen=True)
class CommandedMotion:
    """A motion that a deck has been commanded to play.

    `motion` is its name, or "walk + jog" for a blend, `via` are the motions on the way, and `after` is the one-shot
    that has to end first, or "".
    """

    motion: str
    after: str
    via: tuple[str, ...]
    _wait: Callable[[float], float]

    def wait(self, timeout: float = 30.0) -> float:
        """Waits until the switch has settled, in any thread and as often as you like; the seconds since the command.

        CommandError if another one overtook it. MotiondeckError if it has not settled in time, or the deck has ended.
        """
        return self._wait(timeout)


class LiveDeck(DeckCommands[CommandedMotion]):
    """A deck that is playing; made by `play`. Use it as a context manager, or `close` it; any thread may use it.

    `motions` are all that can be played, `page` is the address of its page, or None, and `motiondeck send` reaches it
    at its `command_port`.
    """

    # A misspelt name, as in `deck.tmpo = 2`, is an error and not an attribute more.
    __slots__ = (
        *("_client", "_opened", "_process", "_reader", "_report", "_starter", "_turns"),
        *("command_port", "motions", "page"),
    )

    def __init__(self, process: subprocess.Popen[bytes], opened: contextlib.ExitStack) -> None:
        """Waits until a process plays. MotiondeckError if it cannot begin, and why.

        It has pipes to its standard input, which keeps it alive, and from its output. Its end closes what was `opened`.
        """
        self._process, self._opened, self._starter = process, opened, os.getpid()
        self._report: dict[str, Any] | None = None
        assert process.stdout is not None
        first = process.stdout.readline()
        ready = _news.decode(first) if first else None
        # A report may be longer than the pipe holds, so a thread reads it while the deck ends.
        self._reader = threading.Thread(target=self._read_report, args=(process.stdout,), daemon=True)
        self._reader.start()
        if not isinstance(ready, Ready):
            self._end()
            raise MotiondeckError(ready.reason if isinstance(ready, Failed) else self._how_it_ended)
        self.motions = tuple(ready.motions)
        self.command_port = ready.command_port
        self.page = f"http://127.0.0.1:{ready.page_port}" if ready.page_port is not None else None
        self._client = CommandClient(self.command_port)
        self._turns = threading.Semaphore(_MOST_AT_ONCE)

    def __enter__(self) -> LiveDeck:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def running(self) -> bool:
        """Whether it still plays."""
        self._refuse_fork()
        return self._process.poll() is None

    @property
    def report(self) -> dict[str, Any] | None:
        """How the run went, as `motiondeck play --json` prints it; None until it has ended."""
        return self._report

    def beat(self, at: float | None = None) -> None:
        """Gives the deck one beat, and locks it to beats if it is not.

        `at` is its time by `time.monotonic()`, s, up to 2 s ago or ahead; None for now. CommandError if it is further
        away, or the network has no phase.
        """
        self._request(commands.GiveBeat(ago=time.monotonic() - at if at is not None else 0.0))

    def push(self, side: Literal["front", "back", "left", "right"], impulse: float = 0.0) -> None:
        """Pushes the simulated body from one of its sides with an impulse, N s; 0 for one that forces a step.

        CommandError if nothing is simulated, or only its kinematics, or its root is fixed.
        """
        self._request(commands.Push(side, impulse))

    def step(self, seconds: float = 0.0) -> None:
        """Plays on in a pause for one tick, or for up to 1 s. CommandError if the deck is not paused."""
        self._request(commands.StepOn(seconds=seconds))

    def events(self) -> Iterator[DeckEvent]:
        """The events of the deck from this call on, as they come, until it ends. MotiondeckError if it has ended."""
        self._refuse_fork()
        client = CommandClient(self.command_port)
        try:
            client.request(commands.Subscribe(), _ANSWERS_WITHIN)
        except SocketError:
            client.close()
            raise SocketError(self._how_it_ended) from None
        return _events_of(client)

    def wait(self, timeout: float | None = None) -> dict[str, Any]:
        """Waits until the deck has ended by its own `seconds`, by a command or by a fault; the report of the run.

        MotiondeckError if it has not ended in time, or ended without a report.
        """
        self._refuse_fork()
        if not self._has_ended(timeout):
            raise MotiondeckError(f"the deck still plays after {timeout:g} s")
        self._end()
        if self._report is None:
            raise MotiondeckError(self._how_it_ended)
        return self._report

    def close(self) -> None:
        """Brings the joints to rest and ends the deck; may be called twice. In a forked process it does nothing."""
        if os.getpid() != self._starter:
            return
        if self.running:
            with contextlib.suppress(SocketError):
                self._client.post(commands.Stop())
        self._end()
        self._client.close()

    def _has_ended(self, timeout: float | None) -> bool:
        """Waits up to `timeout` seconds for the end, without a limit if None; whether the deck has ended."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout)  # the report is read by the thread meanwhile
        return self._process.returncode is not None

    def _end(self) -> None:
        """Waits for the process and takes its report; it is killed if it does not end. May be called twice."""
        if not self._has_ended(_ENDS_WITHIN):
            self._process.kill()
            self._process.wait()
        self._reader.join()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()
        self._opened.close()

    @property
    def _how_it_ended(self) -> str:
        if self._report is not None:
            return f"the deck has ended: {self._report['reason']}"
        code = self._process.returncode
        return f"the deck's process broke off with exit code {code}; its own message stands above"

    def _read_report(self, output: IO[bytes]) -> None:
        for line in output:
            news = _news.decode(line)
            if isinstance(news, Ended):
                self._report = news.report

    def _refuse_fork(self) -> None:
        if os.getpid() != self._starter:  # only what started a process can wait for it
            raise MotiondeckError(
                "this deck belongs to the process that started it: command it there, or from anywhere with "
                f"motiondeck send --command-port {self.command_port}"
            )

    def _commanded(self, message: DeckCommand) -> CommandedMotion:
        reply = self._request(message)
        motion = " + ".join(message.motions)
        assert isinstance(reply, Accepted), "what is not refused is accepted"
        outcome: list[Settled | Refused] = []

        def wait(timeout: float) -> float:
            self._refuse_fork()
            settled = None if outcome else self._client.wait_settled(reply.id, timeout)
            if isinstance(settled, Settled | Refused):
                outcome.append(settled)
            if not outcome:
                raise MotiondeckError(f"{motion} has not settled after {timeout:g} s")
            if isinstance(outcome[0], Refused):
                raise CommandError(outcome[0].reason)
            return outcome[0].seconds

        return CommandedMotion(motion, reply.after, tuple(reply.via), wait)

    def _request(self, message: DeckCommand) -> Accepted | DeckStatus:
        """Sends a command and takes its answer.

        CommandError if it is refused, or an argument has another type. SocketError says why a deck has ended.
        """
        if not self.running:
            self._end()
            raise SocketError(self._how_it_ended)
        message = with_right_types(message)
        stops = isinstance(message, commands.EmergencyStop)  # it waits for no other command
        try:
            with contextlib.nullcontext() if stops else self._turns:
                reply = self._client.request(checked(message), _ANSWERS_WITHIN)
        except SocketError:
            # It may just be ending: then its reason is more useful than a missing answer.
            if self._has_ended(0.0 if stops else 1.0):
                self._end()
                raise SocketError(self._how_it_ended) from None
            raise
        if isinstance(reply, Accepted | DeckStatus):
            return reply
        raise CommandError(reply.reason if isinstance(reply, Refused) else "the deck's answer is not understood")


def _events_of(client: CommandClient) -> Iterator[DeckEvent]:
    with contextlib.closing(client), contextlib.suppress(SocketError):
        while True:
            event = client.receive(_CHECK_EVERY)
            if isinstance(event, DeckEvent):
                yield event
                if event.kind == "ended":
                    return
    yield DeckEvent("ended", "the deck broke off")


def _with_options_of(spec: Callable[P, RunSpec]) -> Callable[[Callable[..., LiveDeck]], Callable[P, LiveDeck]]:
    """Gives a function the parameters of a run's spec, and describes them in its docstring."""

    def decorate(function: Callable[..., LiveDeck]) -> Callable[P, LiveDeck]:
        types, signature = kinds(), inspect.signature(spec)
        plain = [one.replace(annotation=types[one.name]) for one in signature.parameters.values()]
        setattr(function, "__signature__", signature.replace(parameters=plain, return_annotation=LiveDeck))  # noqa: B010
        described = "\n".join(f"        {name}: {option.help}" for name, option in options().items())
        function.__doc__ = (function.__doc__ or "").replace("{options}", described.lstrip())
        return function

    return decorate


@_with_options_of(RunSpec)
def play(*values: Any, **named: Any) -> LiveDeck:
    """Starts a live deck and returns when it plays.

    The deck ends with its `with` block, after `seconds`, or with the program that started it, even if that is killed. A
    keyword has the name and the meaning of the option of `motiondeck play`; `physics=False` is --kinematic, and a page
    is opened with `page=True`, on a free port, or `page=8040`. A library may also be one in memory, and `lock_to` a
    live deck. MotiondeckError if a name does not exist (it names the nearest), or a file, port or rig cannot be used.

    Args:
        {options}
    """
    with contextlib.ExitStack() as opening:
        given = inspect.signature(RunSpec).bind(*values, **named).arguments
        if isinstance(library := given.get("library"), Library):
            file = opening.enter_context(run_folder()) / "played.safetensors"
            library.save(file)
            given["library"] = file
        if isinstance(leader := given.get("lock_to"), LiveDeck):
            given["lock_to"] = leader.command_port
        spec = with_right_types(RunSpec(**given))
        spec.check()
        # In its own session: Ctrl-C is for the program, whose `with` block then ends the deck.
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "motiondeck.run.live_deck", msgspec.json.encode(spec).decode()],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        return LiveDeck(process, opening.pop_all())
