# pyright: strict
"""Motiondeck: learns human motions into small recurrent networks and plays them live on robots and servo rigs.

What this package and `motiondeck.networks` list in `__all__` is public and described in docs/api.md; everything else
may change from one version to the next.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motiondeck import networks
    from motiondeck.libraries import Library, MotionGenerator, learn, learn_recipe, load_library
    from motiondeck.live import CommandedMotion, DeckEvent, DeckStatus, LiveDeck, LockState, play
    from motiondeck.own_loop import CommandedSwitch, Deck
    from motiondeck.recognition import (
        PoseStream,
        RecognitionStream,
        RecognitionVerdict,
        Recognizer,
        learn_recognizer,
        load_recognizer,
    )
    from motiondeck.recordings import Clip, Skeleton, read_recording, save_recording
    from motiondeck.rigs import Rig, open_rig
    from motiondeck.robots import JointMotion, RetargetedFile, Robot, load_robot, retarget_files
    from motiondeck_base.errors import MotiondeckError, UnknownNameError

__all__ = ["MotiondeckError", "UnknownNameError", "networks"]
__all__ += ["Library", "MotionGenerator", "learn", "learn_recipe", "load_library"]
__all__ += ["CommandedMotion", "DeckEvent", "DeckStatus", "LiveDeck", "LockState", "play"]
__all__ += ["CommandedSwitch", "Deck"]
__all__ += ["Clip", "Skeleton", "read_recording", "save_recording"]
__all__ += ["Rig", "open_rig"]
__all__ += ["JointMotion", "RetargetedFile", "Robot", "load_robot", "retarget_files"]
__all__ += ["PoseStream", "RecognitionStream", "RecognitionVerdict", "Recognizer"]
__all__ += ["learn_recognizer", "load_recognizer"]

_HOMES = {
    ".libraries": "Library MotionGenerator learn learn_recipe load_library",
    ".live": "CommandedMotion DeckEvent DeckStatus LiveDeck LockState play",
    ".own_loop": "CommandedSwitch Deck",
    ".recognition": "PoseStream RecognitionStream RecognitionVerdict Recognizer learn_recognizer load_recognizer",
    ".recordings": "Clip Skeleton read_recording save_recording",
    ".rigs": "Rig open_rig",
    ".robots": "JointMotion RetargetedFile Robot load_robot retarget_files",
    "motiondeck_base.errors": "MotiondeckError UnknownNameError",
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names.split()}


def __getattr__(name: str) -> object:
    """Imports a name when it is first used (PEP 562): importing everything takes a second."""
    if name not in __all__:
        raise AttributeError(f"module 'motiondeck' has no attribute '{name}'")
    try:
        home = import_module(_HOME_OF.get(name, f".{name}"), __name__)
    except ImportError as error:
        from motiondeck.command import shadowed

        for line in shadowed():
            raise ImportError(line) from error
        raise
    value = getattr(home, name) if name in _HOME_OF else home
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
