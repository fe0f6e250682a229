"""Learns a file of keyframes and plays it on its rig, in processes beside the page that end with it."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from threading import Thread

_COMMAND = [sys.executable, "-P", "-m", "motiondeck"]
_PATIENCE = 20.0  # s for a rig to come to rest


class Rehearsal:
    """One motion that is learned and played, again and again; a thread waits for the processes."""

    def __init__(self, file: Path, rig: str) -> None:
        self.library = file.with_suffix(".safetensors")
        self._file, self._rig = file, rig
        self._playing: subprocess.Popen[str] | None = None
        self.learned = False  # whether the library is ours
        self.said, self.address = "", ""  # how it is, in words, and the page of the run that plays

    @property
    def playing(self) -> bool:
        """Whether there is a run."""
        return self._playing is not None

    def start(self, *, emulated: bool) -> None:
        """Begins anew, with emulated servos or the rig itself; what plays is ended first."""
        self.said = "learning …"
        Thread(target=self._run, args=(f"emulated:{self._rig}" if emulated else self._rig,), daemon=True).start()

    def stop(self) -> None:
        """Ends what plays; its joints come to rest."""
        if (playing := self._playing) is not None:
            playing.terminate()
            try:
                playing.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                playing.kill()

    def _run(self, rig: str) -> None:
        self.stop()
        learn = [*_COMMAND, "learn", str(self._file), "--out", str(self.library), "--force"]
        learned = subprocess.run(learn, capture_output=True, text=True, check=False)
        if learned.returncode:
            self.said = _last(learned.stderr.splitlines())
            return
        self.learned = True
        self.said = "learned; the rig comes to its first pose …"
        port = self.address.rpartition(":")[2] or "0"  # the tab that shows the last run shows the next one
        play = ["play", str(self.library), "--rig", rig, "--port", port, "--command-port", "0"]
        with subprocess.Popen(
            [*_COMMAND, *play], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as playing:
            self._playing, lines = playing, list[str]()
            assert playing.stderr is not None
            for line in playing.stderr:
                lines.append(line)
                if line.startswith("page: "):
                    self.said, self.address = f"{self.library.name} plays", line.split()[1]
        self._playing = None
        self.said = _last(lines) if playing.returncode else "the run has ended"


def _last(lines: Sequence[str]) -> str:
    return next((line.strip() for line in reversed(lines) if line.strip()), "it has ended without a word")
