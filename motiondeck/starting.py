# pyright: strict
"""Starts a live deck in a process beside this one."""

import contextlib
import inspect
import subprocess
import sys
from collections.abc import Callable
from typing import Any, ParamSpec

import msgspec

from controller.wire.run_folder import run_folder
from motiondeck.libraries import Library
from motiondeck.live import DeckProcess, LiveDeck
from motiondeck.run.live_deck import with_right_types
from motiondeck.run.spec.run_spec import RunSpec, kinds, options

__all__ = ["play"]

P = ParamSpec("P")


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
        return LiveDeck(DeckProcess(process, opening.pop_all()))
