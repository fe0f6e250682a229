"""Authentication: commands over a network are signed with a secret token.

    signed = HMAC-SHA256(token, data) | data

The token itself is never sent. The data is not encrypted. `network_transport` sees to it that nothing is taken twice.
"""

import hashlib
import hmac
import os
import stat
from pathlib import Path

from motiondeck_base.errors import MotiondeckError

SIGNATURE_BYTES = 32
SHORTEST_TOKEN = 16


def read_token(path: Path) -> bytes:
    """The token in a file, without white space around it; MotiondeckError if it is missing, public, or too short."""
    how = f"Make one with: (umask 077; openssl rand -hex 32 > {path})"
    try:
        with path.open("rb") as file:
            about = os.fstat(file.fileno())
            token = file.read(4096).strip()
    except OSError as error:
        raise MotiondeckError(f"{path}: the token cannot be read ({error.strerror or error}). {how}") from None
    if not stat.S_ISREG(about.st_mode) or about.st_mode & 0o077:
        raise MotiondeckError(f"{path}: others may read this token. Forbid that with: chmod 600 {path}")
    if len(token) < SHORTEST_TOKEN:
        raise MotiondeckError(f"{path}: a token has at least {SHORTEST_TOKEN} characters, not {len(token)}. {how}")
    return token


def sign(token: bytes, data: bytes) -> bytes:
    """The data with its signature before it."""
    return hmac.digest(token, data, hashlib.sha256) + data


def verify(token: bytes, signed: bytes) -> bytes | None:
    """The data, or None where the signature was not made with this token; compared in constant time."""
    data = signed[SIGNATURE_BYTES:]
    return data if hmac.compare_digest(signed[:SIGNATURE_BYTES], hmac.digest(token, data, hashlib.sha256)) else None
