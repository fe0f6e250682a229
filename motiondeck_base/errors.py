"""The errors that a user can cause: one clear line each, with the place and the remedy."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from motiondeck_base.words import did_you_mean


class MotiondeckError(Exception):
    """A mistake that the user can correct; the command line prints it without a traceback."""

    @classmethod
    def unwritable(cls, path: str | Path, error: OSError) -> Self:
        """The error for a file or a folder that the system does not write."""
        return cls(f"{path}: cannot be written ({error.strerror or error}). Check folder and free space.")

    @classmethod
    @contextmanager
    def writing(cls, path: str | Path) -> Iterator[None]:
        """Has the error say that a file or a folder cannot be written, if the system refuses it inside."""
        try:
            yield
        except OSError as error:
            raise cls.unwritable(path, error) from None

    @classmethod
    @contextmanager
    def placed(cls, place: str | Path, remedy: str = "") -> Iterator[None]:
        """Makes any of these errors from inside one of this class that names the place, and has a remedy follow."""
        try:
            yield
        except MotiondeckError as error:
            raise cls(f"{place}: {error}{remedy}") from None

    @classmethod
    def missing(cls, path: str | Path, what: str = "file") -> Self:
        """The error for a file that does not exist; `what` else it might have been, as "file or folder"."""
        return cls(f"{path}: there is no such {what}. Check the name.")


def in_words(error: BaseException) -> str:
    """What an error says, behind the name of its type unless it is written for the user."""
    return str(error) if isinstance(error, MotiondeckError) else f"{type(error).__name__}: {error}"


class FileFormatError(MotiondeckError):
    """A file that does not follow its format; the message names the file and the place."""

    @classmethod
    def listing(cls, place: str, problems: Sequence[str]) -> Self:
        """The error for several problems of one file: one line each, and each begins with `place`."""
        return cls("\n".join(f"{place}: {problem}" for problem in problems))


class UnknownNameError(MotiondeckError):
    """A name that does not exist; the message offers the nearest ones."""

    @classmethod
    def among(cls, kind: str, name: str, known: Iterable[str]) -> Self:
        """The error for `name`, which is no known `kind`, with the nearest known names or else the first 20."""
        names = list(known)
        some = ", ".join(names if len(names) <= 20 else [*names[:20], "..."])
        return cls(f"unknown {kind} '{name}'." + (did_you_mean(name, names) or f" There are: {some}."))

    @classmethod
    def check(cls, kind: str, name: str, known: Collection[str], place: str = "") -> None:
        """Raises the error, behind a place such as "rig.toml: ", for a name that is not among those known."""
        if name not in known:
            raise cls(f"{place}{cls.among(kind, name, known)}")

    @classmethod
    def indices(cls, kind: str, names: Iterable[str], known: Sequence[str], place: str = "") -> list[int]:
        """Where names are among those known; the error for one that is not."""
        for name in names:
            cls.check(kind, name, known, place)
        return [known.index(name) for name in names]
