"""Targets that a joint can follow: the safety envelope, braking, slow approaches, and the pace after a stall."""
