"""Learns a file of keyframes and plays it on its rig, in processes beside the page that end with it."""

import subprocess
import sys
from pathlib import Path
from threading import Thread

_COMMAND = [sys.executable, "-P", "-m", "motiondeck"]


class Rehearsal:
    """One motion that is learned and played, again and again; a thread waits for the processes."""

    def __init__(self, file: Path, rig: str) -> None:
        self.library = file.with_suffix(".safetensors")
        self._file, self._rig = file, rig
        self._thread, self._wanted = Thread(), False
        self._process: subprocess.Popen[str] | None = None
        self.learned = False  # whether the library is ours
        self.said, self.address = "", ""  # how it is, in words, and the page of the run that plays

    @property
    def busy(self) -> bool:
        """Whether it is learned or played."""
        return self._thread.is_alive()

    def start(self, *, emulated: bool) -> None:
        """Begins anew, with emulated servos or the rig itself; it must not be busy."""
        self._wanted = True
        self._thread = Thread(target=self._run, args=("emulated:" * emulated + self._rig,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Has what learns or plays end, and nothing play after it; joints come to rest."""
        self._wanted = False
        if self._process is not None:
            self._process.terminate()

    def end(self) -> None:
        """Ends what learns or plays, and waits for that."""
        self.stop()
        if self.busy:
            self._thread.join()

    def _begun(self, *command: str) -> subprocess.Popen[str]:
        """A process that `stop` ends, also where it was called just before."""
        none, pipe = subprocess.DEVNULL, subprocess.PIPE
        process = subprocess.Popen([*_COMMAND, *command], stdin=none, stdout=none, stderr=pipe, text=True)
        self._process = process
        if not self._wanted:
            process.terminate()
        return process

    def _run(self, rig: str) -> None:
        self.said = "learning …"
        with self._begun("learn", str(self._file), "--out", str(self.library), "--force") as learning:
            _, said = learning.communicate()
        if not self._wanted or learning.returncode:
            self.said = said.strip().rpartition("\n")[2] if self._wanted else "stopped"
            return
        self.learned, self.said = True, "learned; the rig comes to its first pose …"
        port = self.address.rpartition(":")[2] or "0"  # the tab that shows the last run shows the next one
        last = ""
        with self._begun("play", str(self.library), "--rig", rig, "--port", port) as playing:
            assert playing.stderr is not None
            for last in playing.stderr:
                if last.startswith("page: "):
                    self.said, self.address = f"{self.library.name} plays", last.split()[1]
        self.said = last.strip() if playing.returncode else "the run has ended"
