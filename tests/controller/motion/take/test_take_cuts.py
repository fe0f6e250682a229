"""A long recording is cut where its behaviour changes, where it rests and where it jumps; a short one is one motion."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bodies import turned, waving
from controller.motion.canonical.clip_edits import span
from controller.motion.take.segmentation import cuts_of

RATE = 60.0


def reaching(seconds, hertz=0.9):
    """The body of `waving`, which lifts both arms to its sides and bends."""
    clip = waving(RATE, seconds, hertz=0.0)
    swing = 0.8 * np.sin(2.0 * np.pi * hertz * np.arange(len(clip)) / RATE)
    rotation = clip.rotation.copy()
    for bone, sign, axis in (("lelb", 1.0, 0), ("relb", -1.0, 0), ("back", 0.5, 1), ("head", 0.4, 1)):
        rotation[:, 1 + clip.skeleton.bones.index(bone)] = turned(sign * swing, axis=axis)
    return replace(clip, rotation=rotation)


def joined(*clips):
    return replace(
        clips[0],
        root_position=np.concatenate([clip.root_position for clip in clips]),
        rotation=np.concatenate([clip.rotation for clip in clips]),
    )


def found(clip, first=0, end=None, **how):
    """The cuts, and the motions in s."""
    cuts = cuts_of(clip, first, len(clip) if end is None else end, **how)
    return cuts, np.array(cuts.motions) / RATE


def test_two_behaviours_are_two_motions_and_it_is_said_why():
    cuts, motions = found(joined(waving(RATE, 9.0), reaching(9.0)))
    assert motions.shape == (2, 2)
    assert abs(motions[0, 1] - 9.0) < 0.5
    assert cuts.decision.decided.startswith("2 motions, from 0.00, ")
    assert cuts.decision.overrule == "--whole, or frames in the recipe"
    assert cuts.decision.notable


def test_the_same_is_one_motion_if_asked_and_in_a_short_recording():
    long, short = joined(waving(RATE, 9.0), reaching(9.0)), joined(waving(RATE, 5.0), reaching(5.0))
    for clip, whole in ((long, True), (short, False)):
        cuts, motions = found(clip, whole=whole)
        assert motions.tolist() == [[0.0, len(clip) / RATE]]
        assert not cuts.decision.notable


def test_one_behaviour_stays_one_motion():
    assert len(found(waving(RATE, 20.0))[1]) == 1


def test_rests_part_motions_and_belong_to_none():
    wave, rest = waving(RATE, 4.0), waving(RATE, 1.5, hertz=0.0)
    _, motions = found(joined(wave, rest, wave, rest, wave))
    begins = [0.0, 5.5, 11.0]
    assert np.abs(motions - [[begin, begin + 4.0] for begin in begins]).max() < 0.3


def test_a_jump_parts_motions_in_a_long_recording_and_hides_the_rest_of_a_short_one():
    def jumping(seconds, at):
        clip = waving(RATE, seconds)
        place = clip.root_position.copy()
        place[round(at * RATE) :, 0] += 3.0
        return replace(clip, root_position=place)

    cuts, motions = found(jumping(20.0, 8.0))
    assert motions.tolist() == [[0.0, 8.0], [8.0, 20.0]]
    assert "jumps by up to 3.0 m" in cuts.jumps[0]
    assert found(jumping(6.0, 2.0))[1].tolist() == [[2.0, 6.0]]


@settings(max_examples=8)
@given(st.lists(st.floats(2.0, 7.0), min_size=2, max_size=4), st.integers(0, 200))
def test_motions_follow_each_other_within_the_part_that_was_asked(lengths, first):
    clip = joined(*(waving(RATE, one) if k % 2 else reaching(one) for k, one in enumerate(lengths)))
    end = len(clip) - 30
    _, motions = found(clip, first, end)
    frames = (RATE * motions).round().ravel()
    assert (np.diff(frames) >= 0).all()
    assert frames[0] >= first
    assert frames[-1] <= end
    again = cuts_of(span(clip, first, end), 0, end - first)
    assert (np.array(again.motions) + first).ravel().tolist() == frames.tolist()
