"""Measures of a motion: how far, how fast, and whether it is the right one."""
