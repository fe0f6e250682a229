"""Compiles the C player to WebAssembly for the page of an export: `python docs/player_wasm.py` after each change.

It needs the package ziglang, 0.17.1 for the same bytes again. The file that is made is in the repository, so that an
export needs no compiler; a section of it, which browsers pass over, has the digest of what it was made from.
"""

import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WEB = ROOT / "motiondeck/export/web"
ENVELOPE = ROOT / "controller/loop/safety/envelope.c"
PLAYER = WEB / "player.wasm"
FLAGS = (
    *("-target", "wasm32-freestanding", "-mcpu=mvp+bulk_memory", "-O2", "-std=c99", "-ffp-contract=off"),
    *("-fno-math-errno", "-nostdlib", "-Ilibc", f"-I{ENVELOPE.parent}", "-DMD_MOST_JOINTS=64", "-fvisibility=default"),
    *("-Wl,--no-entry", "-Wl,--export-dynamic", "-Wl,--export=__heap_base", "-Wl,--strip-all"),
)


def digest_section() -> bytes:
    """The section with the digest of the sources."""
    files = [ENVELOPE, *sorted(WEB.parent.glob("player.*")), *sorted(WEB.rglob("*.[ch]"))]
    digest = hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).digest()
    content = b"\x06source" + digest
    return bytes([0, len(content)]) + content


def compiled() -> bytes:
    """The player as WebAssembly."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder, "player.wasm")
        command = [sys.executable, "-m", "ziglang", "cc", *FLAGS, "-o", str(made), "wasm.c"]
        subprocess.run(command, cwd=WEB, check=True)
        return made.read_bytes() + digest_section()


if __name__ == "__main__":
    PLAYER.write_bytes(compiled())
    print(f"{PLAYER}: {PLAYER.stat().st_size} bytes")
