"""Where the robots, rigs and libraries are that come with the program, and how a name or a path becomes a file."""

from __future__ import annotations

from pathlib import Path

from motiondeck_base.errors import MotiondeckError, UnknownNameError


def shipped_configs() -> Path:
    """The folder of the shipped configuration: inside an installed package, or at the root of a checkout."""
    package = Path(__file__).resolve().parent
    for folder in (package / "configs", package.parent / "configs"):
        if folder.is_dir():
            return folder
    raise MotiondeckError(f"the installation is incomplete: no 'configs' in {package}. Install motiondeck again.")


def find(kind: str, name: str, suffix: str) -> Path:
    """The file of a robot, rig or library: a path where it looks like one, else a shipped one by its name.

    Args:
        kind: "robot", "rig" or "library".
        name: what the user gave.
        suffix: of such files, with the dot.

    Raises:
        MotiondeckError: if there is none; it names the nearest shipped ones.
    """
    path = Path(name)
    if path.suffix == suffix or "/" in name:
        if not path.is_file():
            raise MotiondeckError(f"{name}: there is no such file")
        return path
    folder = shipped_configs() / {"robot": "robots", "rig": "rigs", "library": "libraries"}[kind]
    file = folder / f"{name}{suffix}"
    if not file.is_file():
        raise UnknownNameError.among(kind, name, sorted(p.stem for p in folder.glob(f"*{suffix}")))
    return file
