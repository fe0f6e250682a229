"""Hypothesis strategies for commands of every type."""

from hypothesis import strategies as st

from controller.wire.messages.arguments import Choice, Flag, Number, Text, WeightedMotions
from controller.wire.messages.command_table import BY_WORD, COMMANDS, parse_command
from controller.wire.messages.commands import DeckCommand

NAMES = st.one_of(st.sampled_from(["walk", "jog", "wave", "hip"]), st.text("abc-1", min_size=1, max_size=100)).filter(
    lambda name: name not in BY_WORD
)


def typed_argument(argument) -> st.SearchStrategy[str]:
    """A word that is in the range of an argument."""
    match argument:
        case Text():
            return NAMES
        case Flag():
            return st.just(argument.name)
        case Choice():
            return st.sampled_from(argument.words)
        case Number(whole=True):
            return st.integers(int(argument.lowest), int(argument.highest)).map(str)
        case Number():
            return st.floats(argument.lowest, argument.highest).map(repr)
        case WeightedMotions():
            return st.nothing()
        case _:
            return st.sampled_from(["pause", "tempo 1.5 2", "switch jog", "jog", "lock beat 0.5 4"])


@st.composite
def commands(draw, paths=NAMES) -> DeckCommand:
    """A well-formed command of any type; what `load` names comes from `paths`."""
    row = draw(st.sampled_from(COMMANDS))
    if row.word == "blend":
        names = draw(st.lists(NAMES, min_size=2, max_size=4, unique=True))
        words = [names[0], *(word for name in names[1:] for word in (name, "0.25"))]
    else:
        words = [draw(paths if one.field == "library" else typed_argument(one.argument)) for one in row.arguments]
    return parse_command([row.word, *words])
