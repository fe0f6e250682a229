"""A library with one short loop, and what is baked of it for servo20, made once in a process."""

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import msgspec

from controller.library.motion_library import MotionLibrary, load_library, save_library
from motiondeck.run.baking import bake
from motiondeck_base.shipped import find_library, find_robot


@cache
def human_library():
    """The file of a library with the jog of thesis15 alone."""
    whole, file = load_library(find_library("thesis15")), Path(mkdtemp()) / "jog.safetensors"
    network = whole.network.twin()
    network.motions = ("jog",)
    motions = [motion for motion in whole.info.motions if motion.name == "jog"]
    save_library(MotionLibrary(msgspec.structs.replace(whole.info, motions=motions), network, whole.encoding), file)
    return file


@cache
def baked_jog():
    """The same, baked for servo20."""
    return bake(human_library(), find_robot("servo20"))
