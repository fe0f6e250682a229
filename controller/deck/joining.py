"""Joining: the ways from one motion into another.

- inertialise: the new motion starts at once where it resembles the body most, and the difference fades (`transition`);
- crossfade: both motions are played and their frames mixed in shares that rise smoothly;
- morph: the network itself goes over, as its paper has it (mu of conceptors or readouts);
- cut: the new motion starts at once and nothing is done about the difference; the safety envelope catches up.

By itself the deck lets a network that can go over by itself do so, and else inertialises; while another switch is under
way or two motions are mixed there is only inertialisation.
"""

from __future__ import annotations

from typing import Literal, get_args

Joining = Literal["inertialise", "crossfade", "morph", "cut"]
JOININGS: tuple[Joining, ...] = get_args(Joining)
