"""MVNX files that the test writes from the manual: a person's joints, and what is wrong in broken ones."""

import numpy as np
import pytest

from controller.motion.canonical.canonical_body import landmarks_of
from controller.motion.formats.reading import read_clip
from motiondeck_base.errors import FileFormatError
from people import check_person, moving
from written_files import mvnx_text

MOTION = moving()
TEXT = mvnx_text(MOTION)


def write(tmp_path, text, name="walk.mvnx"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def test_segments_are_where_the_file_has_them(tmp_path):
    clip = read_clip(write(tmp_path, TEXT))
    assert (len(clip), clip.rate, clip.name) == (25, 60.0, "walk")
    check_person(clip, MOTION, tolerance=5e-6)
    assert landmarks_of(clip.skeleton).lacking == []


@pytest.mark.parametrize(
    "change", [lambda text: text.replace("\n", "\r\n"), lambda text: mvnx_text(MOTION, namespace="")]
)
def test_line_ends_and_name_spaces_do_not_matter(tmp_path, change):
    plain, odd = read_clip(write(tmp_path, TEXT)), read_clip(write(tmp_path, change(TEXT), "odd.mvnx"))
    assert np.array_equal(plain.joints(), odd.joints())


def test_a_prop_that_hangs_from_nothing_is_left_out(tmp_path):
    prop = '<segment label="Prop1" id="99"><points><point label="p"><pos_b>0 0 1</pos_b></point></points></segment>'
    text = TEXT.replace("</segments>", prop + "</segments>")
    text = text.replace("</orientation>", " 1 0 0 0</orientation>").replace("</position>", " 9 9 9</position>")
    assert np.array_equal(
        read_clip(write(tmp_path, text)).joints(), read_clip(write(tmp_path, TEXT, "b.mvnx")).joints()
    )


ENTITIES = '<!DOCTYPE m [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>\n<mvnx>&b;</mvnx>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (ENTITIES, r"line 1: document types and entities are not read"),
        (TEXT[: len(TEXT) // 2], "no well-formed XML"),
        (TEXT.replace('frameRate="60"', 'frameRate="0"'), "'0' is no frame rate"),
        (TEXT.replace('frameRate="60"', ""), "'' is no frame rate"),
        (TEXT.replace('type="normal"', 'type="tpose"'), "no frames with orientations"),
        (TEXT.replace("<position>", "<place>").replace("</position>", "</place>"), "frames without positions"),
        (TEXT.replace("</orientation>", " 1</orientation>", 4), "expected 84 numbers"),
        (TEXT.replace("0.970000", "0,970000"), "expected 63 numbers"),
        (TEXT.replace("0.970000", "nan"), "expected 63 numbers"),
        (TEXT.replace("Pelvis/jL5", "Nowhere/jL5"), "a joint leads from 'Nowhere' to 'L5', no segments"),
        (TEXT.replace("<connector1>T8/jNeck", "<connector1>Head/jNeck"), "do not connect all segments to one root"),
        (TEXT.replace("connector2", "connector3"), "no <joints> connect its segments"),
        (TEXT.replace("</mvnx>", 101 * '<subject label="B" frameRate="60"/>' + "</mvnx>"), "more subjects than"),
        (TEXT.replace('label="L5"', 'label="Pelvis"'), "segment 'Pelvis' has no unique name"),
        ("<mvnx/>", "'' is no frame rate"),
    ],
)
def test_a_broken_file_is_one_line(tmp_path, text, said):
    assert text != TEXT
    with pytest.raises(FileFormatError, match=said) as caught:
        read_clip(write(tmp_path, text))
    assert "walk.mvnx" in str(caught.value)
    assert "\n" not in str(caught.value)
