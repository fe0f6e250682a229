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
        self._thread, self._playing = Thread(), list[subprocess.Popen[str]]()
        self.learned = False  # whether the library is ours
        self.said, self.address = "", ""  # how it is, in words, and the page of the run that plays

    @property
    def busy(self) -> bool:
        """Whether it is learned or played."""
        return self._thread.is_alive()

    def start(self, *, emulated: bool) -> None:
        """Begins anew, with emulated servos or the rig itself; it must not be busy."""
        self._thread = Thread(target=self._run, args=("emulated:" * emulated + self._rig,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Has what plays end; its joints come to rest."""
        for playing in self._playing:
            playing.terminate()

    def end(self) -> None:
        """Ends what plays."""
        self.stop()
        for playing in self._playing:
            playing.wait()

    def _run(self, rig: str) -> None:
        self.said = "learning …"
        learn = [*_COMMAND, "learn", str(self._file), "--out", str(self.library), "--force"]
        learned = subprocess.run(learn, capture_output=True, text=True, check=False)
        if learned.returncode:
            self.said = learned.stderr.strip().rpartition("\n")[2]
            return
        self.learned, self.said = True, "learned; the rig comes to its first pose …"
        port = self.address.rpartition(":")[2] or "0"  # the tab that shows the last run shows the next one
        play, last = [*_COMMAND, "play", str(self.library), "--rig", rig, "--port", port], ""
        none, pipe = subprocess.DEVNULL, subprocess.PIPE
        with subprocess.Popen(play, stdin=none, stdout=none, stderr=pipe, text=True) as playing:
            self._playing = [playing]
            assert playing.stderr is not None
            for last in playing.stderr:
                if last.startswith("page: "):
                    self.said, self.address = f"{self.library.name} plays", last.split()[1]
        self._playing = []
        self.said = last.strip() if playing.returncode else "the run has ended"
