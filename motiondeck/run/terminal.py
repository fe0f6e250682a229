"""The prompt of a run: type a motion's name and the deck plays it. A client of the deck, in a child process."""

import contextlib
import sys
import threading
from collections.abc import Callable, Sequence

from controller.wire.command_socket import CommandClient, SocketError
from controller.wire.messages import replies
from controller.wire.messages.arguments import CommandError, described
from controller.wire.messages.command_table import BY_WORD, COMMANDS, parse_command
from controller.wire.messages.commands import DeckCommand, GetStatus, GiveBeat, Subscribe
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.words import did_you_mean

_COMMAND_ROWS = [("MOTION", "switch to a motion"), *((command.usage, command.help) for command in COMMANDS)]
_PROMPT_ROWS = [
    ("Tab", "complete a motion's name"),
    ("F2", "tap: a beat now"),
    ("Ctrl-C, quit", "stop"),
    ("Ctrl-D", "leave the prompt; the deck plays on"),
]


def _table(rows: Sequence[tuple[str, str]]) -> str:
    return "\n".join(f"{typed:29} {effect}" for typed, effect in rows)


HELP = _table([*_COMMAND_ROWS, *_PROMPT_ROWS])
_SEND_HELP = f"""\
A deck must be playing: `motiondeck play` in another terminal. Then, for example:

  motiondeck send status              what is played, and the names of all motions
  motiondeck send switch jog --wait   switch, and wait until it is settled
  motiondeck send tempo 0.5           half as fast
  motiondeck send pause               stand still; resume plays on
  motiondeck send stop                come to rest and end the run

All commands; [ ] may be left out:

{_table(_COMMAND_ROWS)}

The page "The deck" has more about each."""


def help_on(words: Sequence[str]) -> str:
    """What `motiondeck send help` teaches: all commands, or the one named; CommandError if there is no such command."""
    if not words:
        return _SEND_HELP
    command = BY_WORD.get(words[0])
    if command is None:
        hint = did_you_mean(words[0], BY_WORD) or f" There are: {', '.join(BY_WORD)}."
        raise CommandError(f"there is no command '{words[0]}'.{hint}")
    return f"motiondeck send {command.usage}\n  {command.help}"


_HEARTBEAT = 0.3  # s of silence before a status request; after three without an answer the deck is gone
# What replies to commands do not say.
_PRINTED = ("via", "gave up", "recognized", "fault", "fell", "stands", "replayed", "lost")
UNKNOWN = "not in the rig file"
STARTING = 5.0  # s that a deck may take from opening its port to its first tick


def describe(reply: replies.Reply) -> str:
    """A reply in one line; tables in several."""
    match reply:
        case replies.Accepted(after=after, via=via):
            return "accepted" + (f", after {after}" if after else "") + (f", by way of {', '.join(via)}" if via else "")
        case replies.Refused(reason=reason):
            return f"refused: {reason}"
        case replies.Settled(to=to, seconds=seconds):
            return f"settled on {to} after {seconds:.2f} s"
        case replies.Registers():
            rows = (f"{row.address:>5}  {row.name:<28} {row.count:>11}  {row.meaning}" for row in reply.registers)
            return "\n".join([f"{reply.joint}, {reply.model}", *(row.rstrip() for row in rows)])
        case replies.OnPorts(servos=servos, missing=missing):
            found = (f"id {o.servo:>3}  {o.model:<14} firmware {o.firmware:<3} {o.joint or UNKNOWN}" for o in servos)
            return "\n".join([*found, *(f"{joint} does not answer" for joint in missing)])
        case replies.Event(kind=kind, text=text):
            return f"{kind}: {text}"
        case replies.PhaseNow(motion=motion, phase=phase, rate=rate):
            at = f"at phase {phase:.3f}" if phase is not None else "without a phase"
            return f"{motion} {at}" + (f", {rate:+.3f} rounds a second" if rate is not None else "")
        case replies.State():
            how = "paused" if reply.paused else f"at tempo {reply.tempo:.2f}"
            how += f", phase {reply.phase:.2f}" if reply.phase is not None else ""
            how += "".join(f", {name} {value:.3g}" for name, value in reply.inputs.items())
            how += f", {reply.lock}" if reply.lock is not None else ""
            how += "".join(f", {group}: {motion}" for group, motion in reply.layers.items())
            doing = "switching to" if reply.switching else "playing"
            doing = "slowly approaching" if reply.approaching else doing
            mode = "FALLEN; " if reply.fallen else ""
            mode += "" if reply.mode == "playing" else f"{reply.mode}; "
            queue = f"; next: {', '.join(reply.queue)}" if reply.queue else ""
            seen = f"; it looks like {reply.seen[0]} (confidence {reply.seen[1]:.2f})" if reply.seen else ""
            seen += f"; {reply.fell_back}" if reply.fell_back else ""
            doing += f" {described(reply.motion, reply.blend)}"
            return f"{mode}{doing}, {how}{queue}{seen}; motions: {', '.join(reply.motions)}"


class _Interrupted(Exception):
    """Ctrl-C at the prompt; a KeyboardInterrupt would end asyncio's loop as well."""


async def converse(client: CommandClient) -> None:
    """Takes typed commands, with completion, until Ctrl-D or the end of the deck; SocketError if no deck is running."""
    import asyncio  # here, since `send` takes its words from this module

    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import WordCompleter
    from prompt_toolkit.key_binding import KeyBindings
    from prompt_toolkit.patch_stdout import patch_stdout

    state = client.request(GetStatus(), STARTING)
    names = state.motions if isinstance(state, replies.State) else []
    keys = KeyBindings()

    @keys.add("f2")
    def tap(_: object) -> None:
        with contextlib.suppress(SocketError):  # that the deck has ended is noticed elsewhere
            client.post(GiveBeat())

    session: PromptSession[str] = PromptSession(
        completer=WordCompleter([*names, *BY_WORD, "help"]), interrupt_exception=_Interrupted, key_bindings=keys
    )
    print("Type a motion's name (Tab completes), or help.")
    left = threading.Event()
    with patch_stdout():
        listening = asyncio.create_task(asyncio.to_thread(listen_to, client, left.is_set))
        while not listening.done():
            typing = asyncio.create_task(session.prompt_async("> "))
            await asyncio.wait((typing, listening), return_when=asyncio.FIRST_COMPLETED)
            typing.cancel()  # in vain if it is done
            try:
                line = await typing
            except (EOFError, asyncio.CancelledError):
                break
            except _Interrupted:
                line = "stop"
            try:
                if message := _message_in(line):
                    client.post(message)
            except SocketError:
                break
        left.set()
        await listening


def listen_to(client: CommandClient, enough: Callable[[], bool]) -> None:
    """Prints the replies of the deck and what happens, until it replies no more, or `enough` is true."""
    questions: set[int] = set()  # requests whose answers are not printed
    try:
        questions.add(client.post(Subscribe()))
        while not enough() and len(questions) < 3:
            reply = client.receive(_HEARTBEAT)
            if reply is None:
                questions.add(client.post(GetStatus()))
            elif reply.id in questions:
                questions.clear()
            elif not isinstance(reply, replies.Event) or reply.kind in _PRINTED:
                print(describe(reply))
    except MotiondeckError:
        pass
    if not enough():
        print("The deck has ended.")


def _message_in(line: str) -> DeckCommand | None:
    """The message in a typed line, or None where there is nothing to send: help and mistakes are answered here."""
    words = line.split()
    if words == ["help"]:
        print(HELP, flush=True)
    elif words:
        try:
            return parse_command(words)
        except CommandError as error:
            print(error, flush=True)
    return None


def main() -> None:
    """Runs the prompt for the deck of the command port on the command line, until Ctrl-D or the deck's end."""
    import asyncio

    try:
        asyncio.run(converse(CommandClient(int(sys.argv[1]))))
    except MotiondeckError as error:
        print(f"motiondeck: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
