"""The text of an XML file, in whatever encoding it is."""

from __future__ import annotations

import codecs
import re
from pathlib import Path

from motiondeck_base.errors import FileFormatError

_DECLARATION = re.compile(r"<\?xml\b[^>]*\?>")
_ENCODING = re.compile(rb"""<\?xml\b[^>]*\bencoding\s*=\s*["']([\w.-]+)["']""")
UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def xml_text(path: Path) -> str:
    """The text of a file without its XML declaration, which would name an encoding that the text no longer has.

    Its encoding is the one that its first bytes or its declaration say, or UTF-8, or where it is not that, Latin-1.

    Raises:
        FileFormatError: if it cannot be read.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileFormatError(f"{path}: it cannot be read ({error})") from None
    said = _ENCODING.search(content)
    encoding = "utf-16" if content.startswith(UTF16) else said[1].decode() if said else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except (UnicodeDecodeError, LookupError):
        text = content.decode("latin-1")
    return _DECLARATION.sub("", text, count=1).strip().lstrip("\ufeff")
