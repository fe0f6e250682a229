"""Left and right as the names of a robot's limbs tell them."""

from __future__ import annotations

import re

# English, German and Dutch, French, Spanish, Italian, Portuguese, Japanese, Chinese, Korean, Russian, Czech, Polish,
# Hungarian, Swedish, Turkish; of words in one another the longer first.
SIDES = (
    *(("left", "right"), ("links", "rechts"), ("gauche", "droite"), ("izquierda", "derecha"), ("izq", "der")),
    *(("sinistra", "destra"), ("sx", "dx"), ("esquerda", "direita"), ("hidari", "migi"), ("zuo", "you"), ("左", "右")),
    *(("왼", "오른"), ("лев", "прав"), ("lev", "prav"), ("lew", "praw"), ("bal", "jobb"), ("vänster", "höger")),
    *(("sol", "sağ"), ("sol", "sag")),
    ("l", "r"),
)

SHORT = 3  # letters: a word of so few may be part of another one


def is_left(name: str, other: str) -> bool | None:
    """Whether of two names that differ by a word for left and for right only the first is the left one; None if
    unclear. One of the words may be left out, as in "foot" and "foot_left"; numbers do not count."""
    name, other = (re.sub(r"\d+", "", one.lower()) for one in (name, other))
    for left, right in SIDES:
        for at in range(len(name)):
            if name.startswith(left, at) and name[:at] + right + name[at + len(left) :] == other:
                return True
            if name.startswith(right, at) and name[:at] + left + name[at + len(right) :] == other:
                return False
    words = [(word, word == left) for left, right in SIDES for word in (left, right) if len(word) > SHORT]
    for word, side in words:
        if word in name and _bare(name.replace(word, "", 1)) == _bare(other):
            return side
        if word in other and _bare(other.replace(word, "", 1)) == _bare(name):
            return not side
    return None


def _bare(name: str) -> str:
    """A name without what joins its words."""
    return re.sub(r"[\W_]+", "", name)
