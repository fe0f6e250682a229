"""Conceptors: one reservoir, one projection a motion."""
