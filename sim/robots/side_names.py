"""Left and right as the names of a robot's limbs tell them."""

from __future__ import annotations

import re

# English, German, French, Spanish, Italian, Portuguese, Japanese, Chinese; of words in one another the longer first.
SIDES = (
    *(("left", "right"), ("links", "rechts"), ("gauche", "droite"), ("izquierda", "derecha"), ("izq", "der")),
    *(("sinistra", "destra"), ("sx", "dx"), ("esquerda", "direita"), ("hidari", "migi"), ("zuo", "you"), ("左", "右")),
    ("l", "r"),
)


def is_left(name: str, other: str) -> bool | None:
    """Whether of two names that differ by a word for left and for right only the first is the left one; None if
    unclear. Numbers in them do not count."""
    name, other = (re.sub(r"\d+", "", one.lower()) for one in (name, other))
    for left, right in SIDES:
        for at in range(len(name)):
            if name.startswith(left, at) and name[:at] + right + name[at + len(left) :] == other:
                return True
            if name.startswith(right, at) and name[:at] + left + name[at + len(right) :] == other:
                return False
    return None
