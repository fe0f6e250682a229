"""Recognizes files whose content is of another kind than their name says, by their first bytes."""

from pathlib import Path

GZIP, ZIP = b"\x1f\x8b", b"PK\x03\x04"
_WEB_PAGES = (b"<!doctype html", b"<html")
_FBX = (b"Kaydara FBX Binary", b"; FBX ")


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
