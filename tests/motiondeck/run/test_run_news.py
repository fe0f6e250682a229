"""What a run tells of its outputs: each incident once, and again when it happens again."""

from types import SimpleNamespace

from motiondeck.run.report import RunNews


def test_a_parked_output_is_told_in_whole_sentences():
    told = []
    channel = SimpleNamespace(name="rig", output=None, faults=1, fault="id 3 is gone.", parked=True)
    desk = SimpleNamespace(notify=lambda kind, text, motion="": told.append(text))
    RunNews(desk, SimpleNamespace(period=0.25, overruns=0), [channel], []).update()
    assert told == ["rig: id 3 is gone. Nothing more is sent to it"]


def test_an_incident_that_happens_again_is_told_again_and_a_command_is_no_fault():
    told = []
    rig = SimpleNamespace(incidents=[], explain=lambda new: [(text, text != off) for text in new])
    channel = SimpleNamespace(name="rig", output=rig, faults=0, fault="", parked=False)
    desk = SimpleNamespace(notify=lambda kind, text, motion="": told.append((kind, text)))
    news = RunNews(desk, SimpleNamespace(period=0.25, overruns=0), [channel], [])
    off, limp = "knee was switched off on command", "knee is limp"
    rig.incidents = [off]
    news.update()
    rig.incidents.append(limp)
    assert told == []  # what has the same cause may still come
    news.update()
    news.update()
    assert told == [("servo", f"rig: {off}"), ("fault", f"rig: {limp}")]
    rig.incidents.append(limp)
    news.update()
    news.update()
    assert told[2:] == [("fault", f"rig: {limp}")]
