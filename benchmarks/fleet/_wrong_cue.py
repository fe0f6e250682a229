"""Sends a cue that no show may say."""

from __future__ import annotations

import sys
import time
from contextlib import closing
from pathlib import Path

from benchmarks.fleet._stop_judge import DECKS
from controller.wire.messages.commands import Reset, Resume
from motiondeck.shows.link import Link
from motiondeck.shows.membership import with_certificates
from motiondeck.shows.messages import Time, TimedCue, encode, read

_NUMBER = 1_000_000  # later than any cue of the conductor
_AHEAD, _AGAIN = 0.6, 0.02  # s


def main() -> None:
    """Asks for the conductor's time, by its folder of certificates, and sends the cue for soon after that."""
    answers: list[bytes] = []
    with closing(Link(with_certificates(Path(sys.argv[1]), listens=False))) as link:
        until = time.monotonic() + 2.0
        while not answers and time.monotonic() < until:
            link.ask("clock", lambda _, data: answers.append(data))
            time.sleep(0.1)
        if not answers or (answer := read(answers[0], Time)) is None:
            return
        cue = TimedCue(answer.run, _NUMBER, "wrong", answer.seconds + _AHEAD, [*DECKS], [Reset(), Resume()])
        until = time.monotonic() + _AHEAD
        while time.monotonic() < until:  # decks may be connected later than the conductor
            link.publish("cue", encode(cue))
            time.sleep(_AGAIN)
