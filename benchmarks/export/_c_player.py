"""The C player of figures as a program: compiled in a folder, and played as `golden.deck_trace` plays the deck."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np

from controller.motion.rotations import Array
from controller.wire.messages import commands
from controller.wire.messages.commands import DeckCommand
from motiondeck.export.c_folder import PLAYER
from motiondeck.export.figure import UNIT, Figure, words_of
from motiondeck.export.golden import Script, Trace, deck_trace, spelled

SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")


class CPlayer:
    """The player, compiled in a folder with further flags of the compiler."""

    def __init__(self, folder: Path, flags: Sequence[str] = (), *, fixed: bool = False) -> None:
        for source in (*PLAYER, Path(__file__).with_name("_replay.c")):
            shutil.copy(source, folder)
        self._program, self._figure = folder / "replay", folder / "replayed.bin"
        language = ["c++", "-std=c++17", "-DMD_FIXED", "-x", "c++"] if fixed else ["cc", "-std=c99"]
        words = [*language, "-O1", "-ffp-contract=off", *flags, "-o", self._program]
        subprocess.run([*words, folder / "_replay.c", folder / "player.c", "-lm"], check=True)

    def trace(self, figure: Figure, script: Script, ticks: int, measured: Array | None = None) -> Trace:
        """As of `deck_trace`."""
        self._figure.write_bytes(figure.words)
        joints = len(figure.rest)
        start = "n" if measured is None else f"a {' '.join(f'{angle:.9g}' for angle in measured)}"
        text = "\n".join([start, *(f"{tick} {in_letters(command, figure)}" for tick, command in script)])
        done = subprocess.run([self._program, self._figure, str(ticks)], input=text.encode(), capture_output=True)
        if done.returncode:
            raise RuntimeError(done.stderr.decode())
        size = ticks * 2 * joints * 4
        both = (
            np.frombuffer(done.stdout[:size], "<i4" if figure.fixed else "<f4").reshape(ticks, 2, joints).astype(float)
        )
        both *= UNIT if figure.fixed else 1.0
        return Trace(both[:, 0], both[:, 1], [bool(one) for one in done.stdout[size:]])


def groups_of(figure: Figure) -> dict[str, list[str]]:
    """Groups of joints for layers: every other one, and the first half."""
    joints = list(figure.library.skeleton.bones)
    return {"even": joints[::2], "half": joints[: len(joints) // 2]}


def in_letters(command: DeckCommand, figure: Figure) -> str:
    """A command as `_replay.c` reads it."""
    joints, names = list(figure.library.skeleton.bones), figure.library.network.motions
    match command:
        case commands.Layer(group=group, to=to, weight=weight, tempo=tempo):
            mask = 0 if group == "off" else sum(1 << joints.index(one) for one in groups_of(figure)[group])
            return f"l {-1 if 'off' in (group, to) else names.index(to)} {weight} {tempo} {mask}"
        case commands.SetInput(name=name, value=value, seconds=seconds):
            return f"v {joints.index(name)} {value} {seconds} 0"
        case commands.GiveBeat(ago=ago):
            return f"b 0 {ago} 0 0"
        case commands.LockPhase(phase=phase, steps=steps):
            return f"k {steps} {phase} 0 0"
        case commands.Unlock():
            return "u 0 0 0 0"
        case _:
            return f"{' '.join(map(str, spelled(command, names)))} 0"


def random_script(
    figure: Figure, ticks: int, rng: Random, every: float = 40.0, *, layered: bool = False
) -> list[tuple[int, DeckCommand]]:
    """Commands at random, one in `every` ticks in the mean: switches in switches, stops, resets, tempos."""
    made: list[tuple[int, DeckCommand]] = []
    tick, names, joints = rng.randrange(60), figure.library.network.motions, figure.library.skeleton.bones
    while tick < ticks:
        one = rng.choice("sssmmmqqtttjjpgggerrr" + "llllvvvvbbkuhh" * layered)
        command: DeckCommand = {
            "s": lambda: commands.Switch(to=rng.choice(names), direct=rng.random() < 0.3),
            "m": lambda: commands.Blend(
                first=rng.choice(names), second=rng.choice(names), weight=round(rng.uniform(-0.3, 1.3), 2)
            ),
            "q": lambda: commands.Queue(to=rng.choice(names)),
            "t": lambda: commands.SetTempo(factor=round(rng.uniform(-3.0, 3.0), 2), over=rng.choice([0.0, 0.0, 0.7])),
            "j": lambda: commands.Jump(phase=round(rng.random(), 3)),
            "l": lambda: commands.Layer(
                group=rng.choice(["even", "half", "half", "off"]),
                to=rng.choice([*names, "off"]),
                weight=round(rng.random(), 2),
                tempo=round(rng.uniform(0.0, 3.0), 2),
            ),
            "v": lambda: commands.SetInput(
                name=rng.choice(joints), value=round(rng.uniform(-0.9, 0.9), 3), seconds=rng.choice([0.05, 0.5, 1.5])
            ),
            "b": lambda: commands.GiveBeat(ago=round(rng.uniform(0.0, 0.3), 3)),
            "k": lambda: commands.LockPhase(
                source="beat", phase=round(rng.random(), 2), steps=rng.choice([0, 0, 1, 2, 4])
            ),
            "u": commands.Unlock,
            "h": lambda: commands.Heartbeat(within=rng.choice([0.0, 0.1, 0.5, 1.0])),
            "p": commands.Pause,
            "g": commands.Resume,
            "e": commands.EmergencyStop,
            "r": commands.Reset,
        }[one]()
        made.append((tick, command))
        if one == "b":  # a beat goes on for a while, not quite evenly, and some are lost
            period, at = rng.uniform(30.0, 90.0), float(tick)
            made += [
                (round(at + period * beat), commands.GiveBeat(ago=round(rng.uniform(-0.02, 0.02), 3)))
                for beat in range(1, 10)
            ]
        tick += int(rng.expovariate(1.0 / every))
    return sorted(made, key=lambda row: row[0])


def deck_plays(figure: Figure, script: Script, ticks: int, start: Array) -> Trace:
    """What the deck plays, which is paused where a heartbeat is missed: its run in virtual time waits for none."""
    beats = [(tick, one.within) for tick, one in script if isinstance(one, commands.Heartbeat)]
    ends = [tick for tick, _ in [*beats[1:], (ticks, 0.0)]]
    missed = [
        (at, commands.Pause())
        for (tick, within), end in zip(beats, ends, strict=False)
        if within > 0.0 and (at := tick + int(within * figure.rate + 1e-6) + 1) < end
    ]
    given = sorted([*script, *missed], key=lambda row: row[0])  # what is missed comes last in its tick
    deck = deck_trace(figure, given, ticks, start, groups_of(figure))
    told = [yes for row, yes in zip(given, deck.accepted, strict=False) if all(row is not one for one in missed)]
    return replace(deck, accepted=told)


def with_limits(figure: Figure, **limits: Array) -> Figure:
    """The figure with other limits of its joints."""
    changed = replace(figure.limits, **limits)
    return replace(figure, limits=changed, words=words_of(figure.library, changed, figure.rate, fixed=figure.fixed))


def in_fixed_point(figure: Figure) -> Figure:
    """The figure in fixed-point numbers."""
    return with_limits(replace(figure, fixed=True))


def wide(figure: Figure) -> Figure:
    """The figure with limits that no motion reaches, so that the envelope lets all targets pass."""
    ones = np.ones(len(figure.rest))
    rates = {"velocity": 60.0 * ones, "acceleration": 1e4 * ones, "jerk": 2e6 * ones}
    return with_limits(figure, lower=-9.0 * ones, upper=9.0 * ones, **rates)


def beyond_limits(figure: Figure, start: Array, safe: Array) -> float:
    """By which share the safe targets (T, J), rad, of a run from rest at `start` break a limit; at most 0 if none."""
    dt, limits = 1.0 / figure.rate, figure.limits
    path = np.concatenate([np.repeat(start[None], 3, axis=0), safe])
    shares = [
        float((np.abs(np.diff(path, order, axis=0)) / (rate * dt**order)).max()) - 1.0
        for order, rate in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk))
    ]
    return max(*shares, float((limits.lower - safe).max()), float((safe - limits.upper).max()))
