"""The fault matrix: every way to stop a deck with a rig beside every part that may be broken, judged from the wire.

Each trial is a walk on the emulated servo20, a fault and a stop. Faults that stop the joints by themselves (the deck
stopped, killed, or with commands that raise) come 0.1 s before the stop, and time counts from them; all others are
there when the stop is given, and time counts from that. A key device is emulated by a FIFO in /dev/input.
"""

from __future__ import annotations

import contextlib
import math
import os
import random
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from benchmarks.stop import goal_judge as judge
from benchmarks.stop.command_runner import CommandRunner
from benchmarks.stop.judged_rig import MOTIONDECK, ROOT, JudgedDeck, JudgedRig, until
from benchmarks.stop.kills import MOST
from benchmarks.stop.surroundings import LossyNetwork, idle_clients, small_disk, step_clock

MOTION = "walk"
BRAKES_WITHIN, ARRIVES_WITHIN = 0.15, 1.0  # s
SOURCES = {
    "door": "`send estop`",
    "network": "`send estop --host`",
    "wired": "wired stop",
    "signal": "SIGINT, SIGTERM",
    "show": "stop of a show",
    "death": "the deck's death",
    "raising": "commands that raise",
}
FAULTS = {
    "nothing": "nothing",
    "raising": "commands raise",
    "stopped": "deck stopped (SIGSTOP)",
    "killed": "deck killed",
    "page": "page killed",
    "recorder": "recorder killed",
    "cut": "bus cut for 0.3 s",
    "64": "64 idle clients",
    "1000": "1,000 idle clients",
    "loss": "network loses 20 %",
    "link": "link to the show cut",
    "conductor": "conductor killed",
    "disk": "disk of the recording full",
    "clock": "clock stepped by an hour",
}
_REPEATED = ("door", "network", "wired")  # the deck plays on after a reset
_STOPS_ITSELF = ("raising", "stopped", "killed")
_ENDS = ("raising", "killed")  # the run
_BEFORE = 0.1  # s from a fault to the stop
_SEEN = 0.8  # s after the stop
_TURNS_IN = 2  # periods in which joints stand before they go home
_AFTERWARDS = 0.4  # s after the fault is over
_CUT_FOR, _JOINED = 0.3, 0.05  # s; and until the first frame after that
_PATIENCE = 0.17  # s of silence until the servos' watchdogs may have stopped them
_MOST_REPEATED = 5  # times for each repetition, where the machine is too busy to be judged
_FAILURES = 3  # of the harness, after which a stage is given up
_HOUR = 3600.0
_LOSS = 0.2  # of the datagrams, each way
_RAISING = (sys.executable, "-c", "from benchmarks.stop.raising_deck import main; main()")
_EVENT = struct.pack("@llHHi", 0, 0, 1, 30, 1)  # of an input device: a key is pressed
_PORT = 47900


@dataclass
class Trial:
    """One stop beside one fault.

    Attributes:
        at: from when on time counts, s (CLOCK_MONOTONIC).
        broken_at: when a fault of this trial alone began, s.
        end: until when it is judged.
        goes_home: whether the run ends at the rest pose, so that joints may move after they stood.
    """

    source: str
    fault: str
    at: float
    broken_at: float
    end: float
    goes_home: bool = False
    worst: float = 0.0
    braking_after: float | None = None
    still_after: float | None = None
    moved: float = 0.0
    shafts_stand: bool = False

    @property
    def at_rest(self) -> bool:
        """Whether the joints came to rest within their limits and stayed there."""
        stays = self.goes_home or (self.moved == 0.0 and self.shafts_stand)
        return self.worst <= MOST and self.still_after is not None and stays

    @property
    def in_time(self) -> bool:
        """Whether braking began soon enough; what is lost on a network has to be sent again."""
        most = ARRIVES_WITHIN if (self.source, self.fault) == ("network", "loss") else BRAKES_WITHIN
        return self.braking_after is None or self.braking_after <= most


@dataclass(frozen=True)
class Stage:
    """Trials on one rig: one fault and some sources."""

    fault: str
    sources: tuple[str, ...]


def stages(sources: Iterable[str] = SOURCES, faults: Iterable[str] = FAULTS) -> list[Stage]:
    """Trials that one deck after the other can do: those with a page or a show apart, as they take longest, first."""
    found: list[Stage] = []
    for fault in faults:
        groups = [("show",), _REPEATED, ("signal",), ("death",), ("raising",)]
        for group in groups:
            own = tuple(source for source in group if source in sources and (source, fault) not in _SAME)
            if own:
                found.append(Stage(fault, own))
    return sorted(found, key=lambda stage: stage.fault not in ("page", "link", "conductor", "raising", "killed"))


_SAME = {("death", "killed"), ("raising", "raising")}  # source and fault are the same thing: judged beside nothing


def run(stage: Stage, repetitions: int, seed: int) -> tuple[list[Trial], list[str]]:
    """Runs the trials of a stage; they, and what went wrong with the harness itself."""
    trials: list[Trial] = []
    failures: list[str] = []
    repeated = 0
    anew = stage.fault in _ENDS or not set(stage.sources) <= {*_REPEATED, "show"}
    left = [(source, number) for number in range(repetitions) for source in stage.sources]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, ExitStack() as opening:
        folder = Path(name)
        rig = opening.enter_context(JudgedRig(folder))
        around = Around(opening, rig, folder, stage, random.Random(f"{seed} {stage}"))
        while left and len(failures) < _FAILURES:
            try:
                with around.deck():
                    while left:
                        source, number = left.pop(0)
                        trial = around.trial(source, number)
                        _judge(rig, trial)
                        stands = trial.at + 0.1 + (trial.still_after or 0.0)
                        if not rig.disturbed(trial.at - _BEFORE, trial.end if trial.still_after is None else stands):
                            if trial.goes_home and rig.disturbed(stands, trial.end):
                                _judge(rig, trial, stands)  # frames of the way home did not come in time
                            trials.append(trial)
                        elif repeated < _MOST_REPEATED * repetitions:
                            left.append((source, number))
                            repeated += 1
                        else:
                            failures.append(f"{stage.fault}, {source}: this machine is too busy")
                        if anew:
                            break
                        if left:
                            around.go_on(source)
            except (RuntimeError, OSError) as error:
                failures.append(f"{stage.fault}, {', '.join(stage.sources)}: {error}")
    return trials, failures


class Around:
    """A deck, what stands around it, and its faults."""

    def __init__(self, opening: ExitStack, rig: JudgedRig, folder: Path, stage: Stage, rng: random.Random) -> None:
        self._rig, self._folder, self._stage, self._rng = rig, folder, stage, rng
        self._number = _PORT + os.getpid() % 4000
        self._network = LossyNetwork(self._number, _LOSS * (stage.fault == "loss"), rng.randrange(1 << 30))
        opening.callback(self._network.close)
        token = folder / "token"
        token.write_text(f"{rng.randrange(1 << 256):064x}")
        token.chmod(0o600)
        self._token = token
        self._shows = "show" in stage.sources or stage.fault in ("link", "conductor")
        self._wired = _key_device(opening) if "wired" in stage.sources else None
        environment = os.environ | {"TMPDIR": str(folder), "XDG_RUNTIME_DIR": str(folder)}
        folder.chmod(0o700)
        self._runner = CommandRunner(environment, ROOT)
        opening.callback(lambda: self._runner.close())
        self._conductor: subprocess.Popen[str] | None = None
        self._show, self._shows_begun = "", 0
        self._environment = environment
        opening.callback(self._end_conductor)

    @contextlib.contextmanager
    def deck(self) -> Iterator[None]:
        """A deck, beside the fault if that lasts."""
        fault, options = self._stage.fault, ["--command-port", str(self._number)]
        options += ["--listen", "127.0.0.1", "--token-file", str(self._token)]
        options += ["--port", "0"] if fault == "page" else ["--headless"]
        with ExitStack() as opening:
            if fault in ("recorder", "disk"):
                record = opening.enter_context(small_disk(self._folder / "disk")) if fault == "disk" else None
                options += ["--record", str(record or "{folder}/run.rec")]
            if self._wired is not None:
                options += ["--stop-input", self._wired[0]]
            if self._shows:
                self._start_conductor()
                options += ["--show", f"{self._show}/a"]
            raises = "raising" in (fault, *self._stage.sources)
            program = _RAISING if raises else MOTIONDECK
            self._deck = opening.enter_context(JudgedDeck(self._rig, self._folder, MOTION, *options, program=program))
            self._deck.plays()
            module = {"page": "motiondeck.page.viewer", "recorder": "controller.wire.recorder"}.get(fault)
            if module is not None:
                victims = self._deck.processes(module)
                if not victims:
                    raise RuntimeError(f"there is no process {module}")
                for process in victims:
                    os.kill(process, signal.SIGKILL)
            if fault == "conductor":
                self._end_conductor()
            yield

    def trial(self, source: str, number: int) -> Trial:
        """Breaks what is to be broken, stops the deck, and watches."""
        deck, fault = self._deck, self._stage.fault
        self._rig.forget()
        deck.plays()
        time.sleep(0.3)
        time.sleep(self._rng.uniform(0.05, 0.4))
        deck.plays()
        broken_at, mend = self._break()
        if fault in ("stopped", "killed", "raising", "cut", "link", "clock"):
            time.sleep(_BEFORE)
        at = self._press(source, number)
        if fault == "cut":
            time.sleep(max(0.0, broken_at + _CUT_FOR - time.monotonic()))
            mend()
        over = at + _SEEN
        time.sleep(max(0.0, over - time.monotonic()))
        if fault == "link" and source == "show":
            at = time.monotonic()  # the stop comes when the link is back
            over = at + _SEEN
        mend()
        time.sleep(max(_AFTERWARDS, over - time.monotonic()))
        if source == "signal" and fault not in ("killed", "stopped"):
            until(lambda: deck.process.poll() is not None, 10.0)
        goes_home = source in ("signal", "raising") or fault == "raising"
        began = broken_at if fault in _STOPS_ITSELF else at
        return Trial(source, fault, began, broken_at, time.monotonic(), goes_home)

    def go_on(self, source: str) -> None:
        """Resets the emergency stop, and has the deck play on."""
        if source == "show" and self._conductor is not None:
            self._send("reset")
            self._say("go")
            time.sleep(0.3)
        else:
            self._send("reset")
        self._send("resume")
        self._deck.plays()

    def _send(self, word: str) -> None:
        said: object = None
        for _ in range(20):
            self._runner.start("send", word, "--command-port", str(self._number))
            said = self._runner.finish()
            if said is not None and (said[0] == 0 or "nothing to reset" in said[1]):  # an answer may have come too late
                return
            time.sleep(0.1)
        raise RuntimeError(f"{self._stage}: {word} is refused: {said}")

    def _press(self, source: str, number: int) -> float:
        """Gives the stop; when, s."""
        deck, name = self._deck, str(self._number)
        if source == "door":
            return self._runner.start("send", "estop", "--command-port", name)
        if source == "network":
            relay = str(self._network.port)
            words = ("send", "estop", "--command-port", relay, "--host", "127.0.0.1", "--token-file", str(self._token))
            return self._runner.start(*words)
        at = time.monotonic()
        if source == "wired" and self._wired is not None:
            os.write(self._wired[1], _EVENT)
        elif source == "show":
            if self._conductor is not None:
                self._say("stop")
            else:
                return self._runner.start("conduct", str(self._folder / "gala.toml"), "--stop")
        elif deck.process.poll() is None:
            if source == "signal" and number % 2 == 0:
                os.killpg(deck.process.pid, signal.SIGINT)  # as a terminal does on Ctrl-C
            else:
                numbers = {"signal": signal.SIGTERM, "death": signal.SIGKILL, "raising": signal.SIGUSR1}
                deck.signal(numbers[source])
        return at

    def _break(self) -> tuple[float, Callable[[], object]]:
        """Breaks what is to be broken in each trial; when, and what mends it."""
        deck, fault, at = self._deck, self._stage.fault, time.monotonic()
        if fault in ("stopped", "killed", "raising"):
            numbers = {"stopped": signal.SIGSTOP, "killed": signal.SIGKILL, "raising": signal.SIGUSR1}
            deck.signal(numbers[fault])
            if fault == "stopped":
                return at, lambda: deck.process.poll() is None and deck.signal(signal.SIGCONT)
        if fault == "cut":
            self._rig.cut()
            return at, self._rig.join
        if fault == "link":
            members = deck.processes("motiondeck.shows")
            if not members:
                raise RuntimeError("the deck takes part in no show")

            def signal_members(number: int) -> None:
                for member in members:
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(member, number)

            signal_members(signal.SIGSTOP)
            return at, lambda: signal_members(signal.SIGCONT)
        if fault in ("64", "1000"):
            crowd = ExitStack()  # gone before the reset, for which the deck would be full
            crowd.enter_context(idle_clients(self._folder / "motiondeck", int(fault)))
            return at, crowd.close
        if fault == "clock" and step_clock(_HOUR):
            return at, _once(lambda: step_clock(-_HOUR))
        if fault == "loss":
            self._runner.start("send", "status", "--command-port", str(self._network.port), "--host", "127.0.0.1",
                               "--token-file", str(self._token))  # fmt: skip
            self._runner.finish(1.0)
        return at, lambda: None

    def _start_conductor(self) -> None:
        """A show of its own for each deck: a stop that stands would stop the next one too."""
        self._end_conductor()
        self._shows_begun += 1
        self._show = f"gala{self._shows_begun}"
        file = self._folder / "gala.toml"
        cue = '[[cues]]\nname = "opening"\nhold = true\nsay = "resume"\n'
        file.write_text(f'show = "{self._show}"\nif_lost = "go on"\n{cue}')
        self._conductor = subprocess.Popen(
            [*MOTIONDECK, "conduct", str(file), "--headless"],
            env=self._environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            text=True,
            bufsize=1,
            start_new_session=True,
        )

    def _end_conductor(self) -> None:
        if self._conductor is not None:
            self._conductor.kill()
            self._conductor.wait()
            self._conductor = None

    def _say(self, word: str) -> None:
        assert self._conductor is not None
        assert self._conductor.stdin is not None
        self._conductor.stdin.write(f"{word}\n")


def _once(act: Callable[[], object]) -> Callable[[], object]:
    done: list[object] = []
    return lambda: done or done.append(act())


def _key_device(opening: ExitStack) -> tuple[str, int] | None:
    """A FIFO that looks like a key device, and our end of it; None where it cannot be made."""
    folder, path = Path("/dev/input"), Path("/dev/input") / f"motiondeck-stop-{os.getpid()}"
    try:
        folder.mkdir(exist_ok=True)
        path.unlink(missing_ok=True)
        os.mkfifo(path)
    except OSError:
        return None
    opening.callback(path.unlink)
    writer = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    opening.callback(os.close, writer)
    return str(path), writer


def _judge(rig: JudgedRig, trial: Trial, until: float = math.inf) -> None:
    """Judges a trial; its rates until a time, s."""
    goals, shafts = judge.read_goals(rig.bus, rig.joints), judge.read_shafts(rig.shafts)
    track = judge.on_grid(goals.between(trial.at - 2.0, trial.end), rig.joints.period, trial.end)
    here = (track.times > trial.at - rig.joints.period) & (track.times < until)
    if trial.fault == "cut":  # nothing is sent to servos whose watchdogs have stopped them
        here &= (track.times < trial.broken_at + _PATIENCE) | (track.times > trial.broken_at + _CUT_FOR + _JOINED)
    parts = (judge.acceleration_parts(track, rig.joints), judge.velocity_parts(track, rig.joints))
    trial.worst = max(float(part[here].max(initial=0.0)) for part in parts)
    periods = {"periods": _TURNS_IN} if trial.goes_home else {}
    still = judge.standstill(track, rig.joints, trial.at, **periods)
    trial.braking_after, trial.still_after, trial.moved = still.braking_after, still.still_after, still.moved
    trial.shafts_stand = judge.shafts_still_after(shafts.between(trial.at, trial.end), trial.at) is not None


def run_all(repetitions: int, seed: int, lanes: int, chosen: list[Stage]) -> Iterator[tuple[list[Trial], list[str]]]:
    """What `run` gives for each stage, in order; `lanes` stages run at a time."""
    with ProcessPoolExecutor(lanes, mp_context=get_context("spawn")) as pool:
        for future in [pool.submit(run, stage, repetitions, seed) for stage in chosen]:
            yield future.result()


def cell(trials: list[Trial]) -> str:
    """Time to the beginning of braking, p50 and worst, ms; and what is wrong, if anything."""
    if not trials:
        return ""
    times = [1e3 * trial.braking_after for trial in trials if trial.braking_after is not None]
    shown = f"{statistics.median(times):.0f}, {max(times):.0f}" if times else "at rest"
    wrong = []
    if any(trial.worst > MOST for trial in trials):
        wrong.append(f"{max(trial.worst for trial in trials):.1f} of a limit")
    if any(trial.still_after is None for trial in trials):
        wrong.append("no rest")
    if any(not trial.goes_home and trial.moved for trial in trials):
        wrong.append("moves again")
    if any(not trial.goes_home and not trial.shafts_stand for trial in trials):
        wrong.append("shafts move")
    return f"**{shown}: {', '.join(wrong)}**" if wrong else shown


def table(trials: list[Trial]) -> str:
    """The matrix as Markdown: a row for each fault, a column for each source."""
    sources = [source for source in SOURCES if any(trial.source == source for trial in trials)]
    rows = ["| broken | " + " | ".join(SOURCES[source] for source in sources) + " |", "|---" * (len(sources) + 1) + "|"]
    for fault, name in FAULTS.items():
        own = [[one for one in trials if one.fault == fault and one.source == source] for source in sources]
        if any(own):
            rows.append(f"| {name} | " + " | ".join(map(cell, own)) + " |")
    return "\n".join(rows)
