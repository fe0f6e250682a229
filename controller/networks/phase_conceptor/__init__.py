"""Conceptors that a phase drives."""
