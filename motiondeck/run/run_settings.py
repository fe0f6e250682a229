"""How a run goes: what `play`, `replay`, `rig play` and `motiondeck.play` ask of a session."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from motiondeck.run.beside.child_process import PageProcess
from motiondeck.run.recognition.recognition_watch import MismatchPolicy
from motiondeck.run.wired_stop import WiredStop

if TYPE_CHECKING:
    from controller.learning.recognition.recognizer import Recognizer


@dataclass(frozen=True)
class RunSettings:
    """How a run goes, whatever is played on whichever robot.

    Attributes:
        rate: ticks of the loop a second, Hz.
        command_port: where commands come in; 0 for a free port.
        page_port: where the page is, 0 for a free port, None for no page.
        page: its process, if that has been started already.
        terminal: whether there is a prompt.
        progress: whether a terminal shows a line with the motion and the time.
        seconds: how long to play, or None until somebody stops it.
        record: the file in which every tick is recorded, if any.
        outputs: outputs of other packages, each NAME or NAME:ARGUMENT; see `run.plugin_outputs`.
        realtime: whether to ask for real-time scheduling.
        core: the core that the loop is to run on, if it matters; all other processes then keep off it.
        catch_up: whether missed ticks are made up for without waiting, or skipped.
        mismatch: what to do when the joints look like another motion than the commanded one; None does not recognize
            them.
        recognizer: in its place, what recognizes the motion of the body that is played.
        listen: the address of another interface where commands are taken, if they are sealed with the token.
        token: who has it may command.
        stop_input: a wired emergency stop, if there is one; the session closes it.
        library: the file of what is played, if it is a library.
        restarts: whether the caller starts the run again when another library is asked for.
        lock_to: what the phase is locked to from the start: "beat", "body", the command port of another deck of
            this machine, or None.
        show: the show that the deck takes part in and its name there, or its folder of certificates; see
            `motiondeck.shows.membership`.
        robot: what the robot is called in that show.
    """

    rate: float
    command_port: int = 0
    page_port: int | None = None
    page: PageProcess | None = None
    terminal: bool = False
    progress: bool = False
    seconds: float | None = None
    record: Path | None = None
    outputs: tuple[str, ...] = ()
    realtime: bool = False
    core: int | None = None
    catch_up: bool = False
    mismatch: MismatchPolicy | None = None
    recognizer: Recognizer | None = None
    listen: str | None = None
    token: bytes | None = None
    stop_input: WiredStop | None = None
    lock_to: str | None = None
    show: str | None = None
    robot: str = ""
    library: Path | None = None
    restarts: bool = False
