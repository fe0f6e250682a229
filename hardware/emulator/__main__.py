"""python -m hardware.emulator RIG.toml: prints the port of an emulated rig and serves it while its parent lives."""

import os
import sys

from hardware.emulator.pty_server import serve
from hardware.errors import MotiondeckError
from hardware.rig.rig_file import load_rig


def main() -> int:
    """Serves the rig file named on the command line; returns 0, or 1 if the file cannot be used."""
    if len(sys.argv) != 2:
        print("usage: python -m hardware.emulator RIG.toml", file=sys.stderr)
        return 2
    parent = os.getppid()
    try:
        serve(load_rig(sys.argv[1]), lambda port: print(port, flush=True), goes_on=lambda: os.getppid() == parent)
    except MotiondeckError as error:
        print(f"motiondeck: {error}", file=sys.stderr)
        return 1
    except (KeyboardInterrupt, BrokenPipeError):
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main())
