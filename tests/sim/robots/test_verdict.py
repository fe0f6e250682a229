"""One vocabulary: three answers, six questions, and the findings that are the reasons."""

import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sim
from sim.robots.carried_findings import REACH_LIMIT, SegmentAngle, limb_findings
from sim.robots.limb_directions import MEAN_LIMIT, WORST_LIMIT
from sim.robots.verdict import QUESTIONS, REMEDIES, SLOWEST, Finding, RobotVerdict, fastest_passing, limited, summed

CHECKS = sorted(check for checks in QUESTIONS.values() for check in checks)
findings = st.lists(
    st.builds(limited, st.sampled_from(CHECKS), st.floats(0.0, 99.0), st.just(50.0), st.just("mm")), max_size=8
).map(tuple)


@given(findings, st.sampled_from([0.3, 1.0]))
def test_a_verdict_says_what_its_findings_say(found, tempo):
    verdict = RobotVerdict("walk", found, tempo if all(f.ok for f in found) else None, tempo=tempo)
    beyond = [finding for finding in found if not finding.ok]
    assert verdict.ok == (not beyond)
    assert verdict.answer == ("does not fit" if beyond else "plays" if tempo == 1.0 else "at tempo 0.30")
    for question, checks in QUESTIONS.items():
        mine = [finding for finding in found if finding.check in checks]
        failing = [finding.words for finding in mine if not finding.ok]
        expected = "; ".join(failing) if failing else "yes" if mine else "not judged"
        assert verdict.answer_to(question) == expected
    row = msgspec.json.decode(msgspec.json.encode(verdict.row()))
    assert (row["answer"], row["words"]) == (verdict.answer, verdict.words)
    assert msgspec.json.decode(msgspec.json.encode(verdict), type=RobotVerdict) == verdict


def test_the_words_name_joint_number_and_tempo():
    slow = Finding("held back", 0.314, 0.17, "rad", "l_knee", ok=False)
    deep = Finding("self-collision", 12.0, 3.0, "mm", "l_foot and r_foot", ok=False)
    verdicts = (
        RobotVerdict("crawl", (), 1.0),
        RobotVerdict("walk", (slow,), 0.538),
        RobotVerdict("waltz", (slow, deep), None, obstacles=(deep,)),
    )
    assert [verdict.words for verdict in verdicts] == [
        "plays",
        "at tempo 0.54 (held back: l_knee, 0.31 rad)",
        "does not fit (self-collision: l_foot and r_foot, 12 mm)",
    ]
    assert summed(verdicts) == "1 play, 1 at a slower tempo, 1 do not fit"


def test_every_check_that_can_fail_has_a_question_and_a_remedy():
    source = "".join(file.read_text() for file in Path(sim.__path__[0]).rglob("*.py"))
    found = re.findall(r'\b(?:limited|_angle|of_joints|Finding)\(\s*"([^"]+)", [^,]+, (?!None)', source)
    failing = set(found) | {"out of reach", "held back"}  # causes of a limb's error are checks too
    assert len(failing) > 12
    assert failing <= set(CHECKS)
    assert failing <= set(REMEDIES)
    assert set(REMEDIES) <= set(CHECKS)
    assert len(CHECKS) == len(set(CHECKS))


@pytest.mark.parametrize(
    ("cause", "mean", "worst", "check", "ok"),
    [
        ("carried wrongly", 16.0, 20.0, "carried wrongly", False),
        ("carried wrongly", 5.0, 46.0, "carried wrongly", False),
        ("held back", 16.0, 20.0, "held back", False),
        ("out of reach", 20.0, 90.0, "out of reach", True),
        ("out of reach", REACH_LIMIT + 1.0, 90.0, "out of reach", False),
        ("out of reach", 10.0, 20.0, "carried wrongly", True),  # of its limb the other segment is off
    ],
)
def test_a_limb_that_is_off_is_found_under_its_cause(cause, mean, worst, check, ok):
    off = {"l_forearm": SegmentAngle(mean, worst, 0, cause), "l_upper_arm": SegmentAngle(1.0, 2.0, 0)}
    found = {finding.check: finding for finding in limb_findings(off)}
    assert (found[check].where, found[check].ok) == ("l_forearm", ok)
    assert found[check].limit in (MEAN_LIMIT, WORST_LIMIT, REACH_LIMIT)


@given(st.floats(0.05, 1.5))
def test_the_fastest_tempo_below_a_threshold_is_found(threshold):
    found = fastest_passing(lambda tempo: tempo <= threshold, 1.0, 1.02)
    if threshold < SLOWEST:
        assert found is None
    else:
        assert min(threshold, 1.0) / 1.03 < found <= min(threshold, 1.0)
