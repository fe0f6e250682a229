"""The folder of a run stays while the run lasts, also when others start at the same moment."""

import fcntl
import tempfile

from controller.wire import run_folder as folders


def test_a_folder_that_another_run_takes_for_abandoned_is_made_anew(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    flock, others = fcntl.flock, []

    def late(file, how):
        if not others:
            others.append("a run that starts between folder and lock")
            folders._remove_abandoned(tmp_path)
        flock(file, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with folders.run_folder() as folder:
        assert others
        folders._remove_abandoned(tmp_path)
        assert [*tmp_path.iterdir()] == [folder]
    assert [*tmp_path.iterdir()] == []
