"""Joining: the ways from one motion to another.

- inertialise: the new motion starts at once where it resembles the body most, and the difference fades (`transition`);
- crossfade: both motions run, and the weight of the new one rises smoothly;
- morph: the network itself changes from one to the other, as its paper defines it (mu of conceptors or readouts);
- cut: the new motion starts at once with a jump; the safety envelope catches up.

By default networks with a switching module of their own morph, and all others inertialise. While another switch is
under way or motions are blended, every switch inertialises.
"""

from typing import Literal, get_args

Joining = Literal["inertialise", "crossfade", "morph", "cut"]
JOININGS: tuple[Joining, ...] = get_args(Joining)
