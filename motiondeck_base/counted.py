"""A number with the word that it counts: 1 frame, 2 frames, 2 switches."""


def counted(number: int, one: str) -> str:
    """The number and the word, which takes an s, or es behind ch, sh and s, unless the number is 1."""
    ending = "es" if one.endswith(("ch", "sh", "s")) else "s"
    return f"{number} {one}" if number == 1 else f"{number} {one}{ending}"
