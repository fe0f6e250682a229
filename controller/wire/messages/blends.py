"""A blend of motions: its weights and their description."""

from collections.abc import Sequence

from controller.wire.messages.arguments import PART, WEIGHT, CommandError

MOST_BLENDED = 4  # the most motions of a blend


def blend_weights(first: str, second: str, weight: float, also: Sequence[tuple[str, float]] = ()) -> dict[str, float]:
    """The weights of the motions of a blend, the first with what is left; CommandError says what is allowed."""
    parts = [(second, weight), *also]
    names = [first, *(name for name, _ in parts)]
    for name in names:
        if names.count(name) > 1:
            raise CommandError(f"a blend takes two motions or more, not {name} twice")
    if len(names) > MOST_BLENDED:
        raise CommandError(f"a blend takes at most {MOST_BLENDED} motions, not {len(names)}")
    for _, part in parts:
        (PART if also else WEIGHT).check(part)
    rest = 1.0 - sum(part for _, part in parts)
    if also and rest < -1e-9:
        raise CommandError(f"the weights of a blend sum to at most 1, not to {1.0 - rest:g}; {first} has what is left")
    return {first: rest if abs(rest) > 1e-9 else 0.0} | dict(parts)


def described(first: str, blend: Sequence[tuple[str, float]]) -> str:
    """A motion and what is blended into it, in words: "walk with 0.30 of jog and 0.20 of waltz"."""
    parts = [f"{weight:.2f} of {name}" for name, weight in blend]
    return f"{first} with {' and '.join(parts)}" if parts else first
