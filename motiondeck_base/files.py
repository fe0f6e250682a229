"""Reads and writes files that the user names; every failure is one clear line."""

import codecs
import hashlib
import math
import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import msgspec

from motiondeck_base.errors import FileFormatError, MotiondeckError

LARGEST = 256 * 2**20  # bytes; CMU's files need that much for three quarters of an hour
GZIP, ZIP = b"\x1f\x8b", b"PK\x03\x04"
_WEB_PAGES = (b"<!doctype html", b"<html")
_FBX = (b"Kaydara FBX Binary", b"; FBX ")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a text file, split into words, with its place for error messages."""

    path: str | Path  # the file, as the user named it
    number: int  # of the line, from 1
    words: list[str]  # what stands there, comments removed

    def error(self, problem: str) -> FileFormatError:
        """The error that names this place."""
        return FileFormatError(f"{self.path} line {self.number}: {problem}")

    def numbers(self, count: int) -> list[float]:
        """The `count` finite numbers after the first word (FileFormatError if they are not there)."""
        found = self.words[1 : 1 + count]
        if len(found) < count:
            raise self.error(f"expected {count} number{'s' * (count > 1)} after '{self.words[0]}', found {len(found)}.")
        return [self.number_from(word) for word in found]

    def number_from(self, word: str) -> float:
        """A word of this line as a finite number (FileFormatError if it is none)."""
        value = as_float(word)
        if value is None or not math.isfinite(value):
            raise self.error(no_number(word))
        return value

    def numbers_or_gaps(self, words: Iterable[str], largest: float = math.inf) -> list[float]:
        """Words of this line as numbers <= `largest`, NaN for "" and "none"; FileFormatError if one is neither."""
        found: list[float] = []
        for word in words:
            value = as_float(word)
            if value is None and word.strip().lower() in ("", "none"):
                value = math.nan
            if value is None or abs(value) > largest:
                raise self.error(no_number(word.strip()))
            found.append(value)
        return found


def no_number(word: str) -> str:
    """What is wrong with a word that is no finite number, and what to do."""
    remedy = "Write decimals with a dot." if "," in word else "Export the recording again."
    if word.endswith(",") and as_float(word.rstrip(",")) is not None:
        remedy = "Put blanks between numbers, not commas."
    return f"expected a number, found '{shortened(word)}'. {remedy}"


def as_float(word: str) -> float | None:
    """The number that a word writes, or None; Python's digit groups (1_000) are not numbers in any motion file."""
    try:
        return None if "_" in word else float(word)
    except ValueError:
        return None


def shortened(word: str) -> str:
    """A word from a file, fit to stand in a message."""
    printable = word if word.isprintable() else ascii(word)[1:-1]
    return printable if len(printable) <= 40 else printable[:37] + "..."


def listed(names: Iterable[str]) -> str:
    """The first few of some names, for a message."""
    every = [shortened(name) for name in names]
    return ", ".join(every[:8]) + (", ..." if len(every) > 8 else "")


def what_it_is(path: str | Path, content: bytes, *, archive: bool = False) -> str | None:
    """What a file is, by its beginning, instead of what its name says, and the remedy; None if it begins as none.

    A zip archive is expected where `archive` says so.
    """
    beginning = content[:1024].lstrip().lower()
    if content.startswith(b"version https://git-lfs.github.com/spec/"):
        return "a Git LFS pointer, which stands for the file. Fetch the file itself: git lfs pull"
    if content.startswith(GZIP):
        return f"the file is packed by gzip. Unpack it: gunzip < {Path(path).name} > NEW."
    if content.startswith(ZIP) and not archive:
        return "a zip archive. Unpack it, and give the files in it."
    if beginning.startswith(_WEB_PAGES):
        return "a web page, such as a site sends instead of a file. Fetch the file again."
    if content.startswith(_FBX):
        return "an FBX file under another name. Convert it, in Blender or with FBX2glTF, to .glb or .bvh."
    return None


def read_bytes(path: str | Path, largest: int = LARGEST, *, archive: bool = False) -> bytes:
    """The content of a file; a zip archive is refused unless `archive`.

    FileFormatError if it cannot be opened, is empty, is larger than `largest` bytes, or is plainly something else than
    its name says; it says what.
    """
    try:
        with Path(path).open("rb") as file:
            size = os.fstat(file.fileno()).st_size or largest  # a pipe does not tell its size
            content = file.read(min(size, largest) + 1)  # Python sets aside all that it is asked for
    except (OSError, ValueError) as error:  # ValueError: a name with a zero byte in it
        reason = getattr(error, "strerror", None) or str(error)
        raise FileFormatError(f"{path}: cannot be read ({reason}). Check the name and the permissions.") from error
    if not content:
        raise FileFormatError(f"{path}: the file is empty. Fetch it again.")
    if len(content) > largest:
        raise FileFormatError(
            f"{path}: larger than {largest // 2**20} MiB, the most that is read. Cut a recording into pieces."
        )
    if found := what_it_is(path, content, archive=archive):
        raise FileFormatError(f"{path}: {found}")
    return content


def read_lines(path: str | Path, largest: int = LARGEST) -> Iterator[str]:
    """The lines of a text file with any line ends, without them, one after the other; see `read_text`."""
    # Not str.splitlines: it would also split at bytes that are letters or dots in other alphabets.
    content = read_bytes(path, largest)
    if b"\0" in content or b"\r" in content or not (content.isascii() and Path(path).is_file()):
        yield from _text_of(path, content).split("\n")
        return
    del content  # as large as the file
    with Path(path).open(encoding="ascii") as file:
        yield from (line.removesuffix("\n") for line in file)


def read_text(path: str | Path, largest: int = LARGEST) -> str:
    """A text file, every line of which ends with one newline, whatever its line ends were.

    Names may be in any language: text is UTF-8, UTF-16 where the file begins by saying so, and otherwise one character
    a byte. What editors write before the text to name its alphabet is left out. FileFormatError as of `read_bytes`, or
    if the file is not text.
    """
    return _text_of(path, read_bytes(path, largest))


def _text_of(path: str | Path, content: bytes) -> str:
    content = content.removeprefix(codecs.BOM_UTF8)
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if wide else "utf-8", errors="replace" if wide else "strict")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    if "\0" in text:
        raise FileFormatError(f"{path}: this is not a text file. Is it the right one?")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def write_file(path: Path, *parts: bytes | memoryview, mode: int = 0o666) -> None:
    """Writes a file under a temporary name and renames it, so that it is whole or not there.

    What is no file, such as /dev/stdout or a pipe, is written to as it is, and stays what it is. FileFormatError if it
    cannot be written.
    """
    with FileFormatError.writing(path):
        if path.exists() and not path.is_file():
            path.write_bytes(b"".join(parts))
        else:
            _replace(path.resolve(), parts, mode)  # a link stays one


def digest_of(path: Path) -> str:
    """The digest of a file's contents."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def keep(path: Path, content: bytes) -> None:
    """Writes a file that only saves time, and its folder; a full disk, or a folder of others, costs that time."""
    with suppress(MotiondeckError, OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, content)


def read_kept(path: Path, kind: type[T]) -> T | None:
    """What is kept in a JSON file as values of a type; None where there is no such file, or it is damaged."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None


def _replace(path: Path, parts: Iterable[bytes | memoryview], mode: int) -> None:
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        # By default opened with 0o666, so that the user's umask decides who may read the file.
        with os.fdopen(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode), "wb") as file:
            file.writelines(parts)
            file.flush()
            os.fsync(file.fileno())  # or a power failure after the rename could leave an empty file
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def way_from(folder: Path, file: str) -> str:
    """A path as it is written into a file of a folder: relative to that, with /; a relative one stays as it is."""
    path = Path(file)
    if not path.is_absolute():
        return file
    if path.is_relative_to(folder.absolute()):
        return path.relative_to(folder.absolute()).as_posix()
    return Path(os.path.relpath(path.parent.resolve() / path.name, folder.resolve())).as_posix()


def check_folder(*files: Path | None) -> None:
    """Checks, before anything is computed, that there are folders for files to write; else a MotiondeckError."""
    for file in files:
        if file is None:
            continue
        folder = file.absolute().parent
        if not folder.is_dir():
            raise MotiondeckError(f"{file.parent}: there is no such folder to write {file.name} to")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise MotiondeckError(f"{file}: nothing can be written to the folder {folder}. Give a place of your own.")
