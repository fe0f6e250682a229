"""Show files: what a mistake is called, and where it is."""

import pytest

from motiondeck.shows.show_file import read_show, wrong_motions
from motiondeck_base.errors import FileFormatError


def written(folder, text):
    file = folder / "show.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('shwo = "gala"', "unknown key 'shwo'. Did you mean 'show'?"),
        ('show = "Gala Night"', "'Gala Night' cannot name a show"),
        ('show = "gala"\nif_lost = "dance"', "dance"),
        ('show = "gala"\nlost_after = 0.1', "lost_after"),
        (
            'show = "gala"\n[[cues]]\nsay = "switch walk"',
            "cue 1: give one of at, hold = true and when, which say when it comes",
        ),
        ('show = "gala"\n[[cues]]\nat = 1\nhold = true\nsay = "pause"', "not at and hold"),
        ('show = "gala"\n[[cues]]\nat = 1\nsay = "dance wildly now"', "cue 1: 'dance wildly now' is not a command"),
        ('show = "gala"\n[[cues]]\nat = 1\nsay = "tempo 9"', "cue 1: tempo:"),
        ('show = "gala"\n[[cues]]\nat = 1\nsay = []', "cue 1: say is empty"),
        ('show = "gala"\n[[cues]]\nat = 1\nname = "off"\nsay = "reset"', "cue 1 'off': 'reset' is not for a show"),
        ('show = "gala"\n[[cues]]\nat = 1\nsay = "load x walk"', "'load' is not for a show"),
        ('show = "gala"\n[[cues]]\nwhen = "ready"\nsay = "pause"', "'ready'"),
        ('show = "gala"\n[[cues]]\nat = 1\nwithin = 2\nsay = "pause"', "within belongs to when"),
        ('show = "gala"\n[[cues]]\nat = 2\nsay = "pause"\n[[cues]]\nat = 1\nsay = "pause"', "cue 2: at = 1 is before"),
        ('show = "gala"\ndecks = ["left"]\n[[cues]]\nat = 1\nto = ["lift"]\nsay = "pause"', "Did you mean left?"),
        ('show = "gala"\ndecks = ["left"]\n[groups]\nb = ["right"]', "unknown deck 'right'"),
        ('show = "gala"\n[groups]\nall = ["right"]', "'all' is always there"),
        ('show = "gala"\n[groups]\nconductor = ["right"]', "the conductor cannot be a group"),
        ('show = "gala"\ndecks = ["conductor"]', "the conductor cannot be a deck"),
        ('show = "gala"\ndecks = ["left", "left"]', "deck 'left' is named twice in [decks]"),
        ('show = "gala"\ndecks = ["left"]\n[groups]\nleft = ["left"]', "the group 'left' has the name of a deck"),
        ('show = "gala"\n[groups]\nsides = []', "the group 'sides' has no decks"),
        ('show = "gala"\n[groups]\nsides = ["Left"]', "'Left' cannot name a deck"),
        ('show = "gala"\n[groups]\nsides = ["left"]\nends = ["sides"]', "a group has decks, no other groups"),
        ('show = "gala"\n[[cues]]\nat = 1\nto = []\nsay = "pause"', "cue 1: to is empty"),
        ('show = "gala"\n[[cues]]\nat = 1\nto = "Left"\nsay = "pause"', "cue 1: 'Left' cannot name a deck or group"),
        ('show = "gala"\n[[cues]]\nat = 1\nname = "2"\nsay = "pause"', "cue 1 '2': a name that is a number"),
    ],
)
def test_a_mistake_is_named_with_its_place(tmp_path, text, says):
    file = written(tmp_path, text)
    with pytest.raises(FileFormatError) as caught:
        read_show(file)
    assert says in str(caught.value)
    assert all(line.startswith(str(file)) for line in str(caught.value).splitlines())


def test_groups_and_decks_are_taken_once(tmp_path):
    show = read_show(written(tmp_path, 'show = "gala"\n[groups]\nsides = ["left", "right"]'))
    assert show.members(["right", "sides"], ["left", "middle", "right"]) == ["right", "left"]
    assert show.members(["all"], ["left", "middle"]) == ["left", "middle"]


def test_a_cue_is_for_one_name_or_several(tmp_path):
    cues = "".join(f'[[cues]]\nat = 1\nsay = "pause"\n{to}\n' for to in ("", 'to = "left"', 'to = ["left", "right"]'))
    show = read_show(written(tmp_path, f'show = "gala"\ndecks = ["left", "right"]\n{cues}'))
    assert [cue.receivers for cue in show.cues] == [["all"], ["left"], ["left", "right"]]


def test_a_motion_that_a_deck_lacks_is_named(tmp_path):
    show = read_show(written(tmp_path, 'show = "gala"\n[[cues]]\nat = 0\nsay = ["switch wlk", "tempo 1"]'))
    (problem,) = wrong_motions(show, {"left": {"walk": 1.0}})
    assert problem == "cue 1: left: unknown motion 'wlk'. Did you mean walk?"
