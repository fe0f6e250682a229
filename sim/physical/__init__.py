"""Motions that a robot can do on its own feet, found by simulation."""
