"""Shipped libraries, read once for all tests of a process: they do not change, and decks share what they find."""

from functools import cache

from controller.library.motion_library import load_library
from motiondeck_base.shipped import find_library


@cache
def shipped(name="thesis15"):
    """A shipped library."""
    return load_library(find_library(name))
