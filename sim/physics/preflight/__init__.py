"""Checks of a robot before it plays a motion or a switch, and the tempo at which they pass."""
