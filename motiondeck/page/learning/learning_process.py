"""The page's side of the learning process, and the messages between the two: one request, then answers."""

import subprocess
from collections.abc import Iterator, Sequence

import msgspec


class LearnRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is to be done."""

    file: str  # the recording; what belongs to it, such as a skeleton, lies beside it
    name: str = ""  # of the motion; "" to look at the recording only
    within: tuple[float, float] | None = None  # the part to take, from and to, s
    library: str = ""  # the file to add the motion to


class HandRecording(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The joints of a rig while hands moved them: what the page has seen, as a file with the ending HAND."""

    joints: list[str]
    rate: float  # of the rig, Hz; what is made of it has it too
    times: list[float]  # s, shape (T,)
    angles: list[list[float]]  # rad, shape (T, J)


HAND = ".hand"


class LearningStep(msgspec.Struct, frozen=True, tag="step"):
    """What is being done, in words."""

    text: str


class Seen(msgspec.Struct, frozen=True, tag="seen"):
    """A recording: how long it is, which part moves, s, and what it looks like: some poses, or how joints turned."""

    seconds: float
    moving: tuple[float, float]
    file: str  # what to learn it from
    # Positions of the joints, shape (poses, 1 + B, 3), m, each about its own root.
    figures: list[list[list[float]]] = []
    parents: list[int] = []  # of the bones, -1 for the root
    angles: list[list[float]] = []  # of the joints of a rig, shape (J, T), rad


class Learned(msgspec.Struct, frozen=True, tag="learned"):
    """The library that has the motion, and how it plays."""

    library: str
    motion: str
    text: str


class NotLearned(msgspec.Struct, frozen=True, tag="failed"):
    """Why not, and what to do."""

    reason: str


News = LearningStep | Seen | Learned | NotLearned

_news = msgspec.json.Decoder(News)
_ENDED = "the process that learns has ended without an answer; its message stands in the deck's terminal"


def work(command: Sequence[str], request: LearnRequest) -> Iterator[News]:
    """What the process says while it carries out a request; the last is what came of it."""
    with subprocess.Popen([*command, msgspec.json.encode(request).decode()], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        last: News | None = None
        try:
            for line in process.stdout:
                last = news = _news.decode(line)
                yield news
        except msgspec.MsgspecError:
            process.kill()
            last = None
        if last is None or isinstance(last, LearningStep):
            yield NotLearned(_ENDED)
