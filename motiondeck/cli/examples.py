"""`motiondeck examples`: copies examples, configs and a recording to start from."""

import shutil
from pathlib import Path
from typing import Annotated

from typer import Argument

from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.shipped import shipped_configs

_TRY = """wrote examples/, configs/ and walk.bvh to {0}. In that folder:

  motiondeck learn walk.bvh --play                       a recording
  motiondeck learn examples/head --out faces.safetensors
  motiondeck play look --library faces.safetensors --rig emulated:examples/head/head.toml
                                                         a head of eight servos
  python examples/play_ten_lines.py                      a script (examples/README.md)"""


def examples(folder: Annotated[Path, Argument(metavar="DIR", help="A folder to make, or an empty one.")]) -> None:
    """Copy examples, configs and a recording into a folder.

    There the scripts, and the command lines of the documentation that name examples/ or configs/, run as they stand.
    walk.bvh is a walk made for Motiondeck, free to use. Nothing is replaced.

    Example:  motiondeck examples motions
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise MotiondeckError(f"{folder}: is there already. Name a new folder; nothing is replaced")
    with FileFormatError.writing(folder):
        for name in ("examples", "configs"):
            ours = shutil.ignore_patterns("*.safetensors", "__pycache__")
            shutil.copytree(shipped_configs(name), folder / name, ignore=ours)
        (folder / "examples" / "walk.bvh").rename(folder / "walk.bvh")
    print(_TRY.format(folder))
