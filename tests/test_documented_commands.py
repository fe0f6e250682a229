"""Every command line of the pages is run, in a folder that has the files that it names: `pytest -m documented`.

That takes some minutes, so these tests are left out where they are not asked for; that the program understands every
line is tested in test_documentation.py always. Three pages are typed line by line by tests of their own. What needs
servos, other machines or downloads is named in NEEDS, with the reason.
"""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from bodies import waving
from controller.motion.formats.reading import read_clip
from controller.motion.formats.writing import bvh_text, write_clip
from controller.wire.run_recording import RecordingWriter
from motiondeck_base.shipped import find_library, find_rig
from small_robots import humanoid
from test_documentation import PAGES, command_lines

pytestmark = [pytest.mark.documented, pytest.mark.timeout(600)]

OWN_TESTS = ("first-motion.md", "first-rig.md", "cookbook.md")
HISTORY = ("CHANGELOG.md",)
NEEDS = {
    r"^rig (scan|play)$|/dev/tty": "servos",
    r"dask://": "a cluster",
    r"--host |--listen 0|certificates gala|--certificates": "other machines",
    r"conduct gala.toml --": "the decks of a show",
    r"catalogue|unitree_g1|g1.toml": "models that are downloaded",
    r"^rig teach$|^gamepad$": "hands",
    r"styles|gait.safetensors|input speed": "a library with inputs",
    r"^learn motions$": "motions that retarget wrote",
    r"tune-walk": "an hour",
    r"\.parquet": "a dataset of LeRobot",
}
# A name of a command alone is no command line, unless that does something.
WHOLE = {"play", "library list", "send help", "robot list"}
# These go on until they are ended.
FOR_EVER = re.compile(r"^(play|clip view|rig emulate|stage|conduct|events|gamepad)\b")


def needs(line):
    """What a line needs that no test has, or nothing."""
    return next((what for pattern, what in NEEDS.items() if re.search(pattern, line)), "")


def lines():
    """All that is to be run, as parameters."""
    for page in PAGES:
        if page.name in OWN_TESTS + HISTORY:
            continue
        for line in dict.fromkeys(command_lines(page)):
            words = line.strip()
            if words in WHOLE or len(shlex.split(words)) > 1 + (
                words.split()[0] in ("rig", "robot", "clip", "library")
            ):
                marks = pytest.mark.skip(reason=f"needs {lacks}") if (lacks := needs(words)) else ()
                yield pytest.param(words, id=f"{page.stem}: {words}", marks=marks)


@pytest.fixture
def folder(tmp_path, mocap_data):
    """The files that the pages name."""
    walk, other = (mocap_data / f"bvh/bandai/{name}_normal_001.bvh" for name in ("walk", "run"))
    for name in ("walk.bvh", "wave.bvh", "skip.bvh", "recordings/walk.bvh"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(walk, tmp_path / name)
    for name in ("run.bvh", "recordings/run.bvh"):
        shutil.copy(other, tmp_path / name)
    (tmp_path / "session.bvh").write_text(bvh_text(waving(30.0, 20.0)))
    shutil.copy(mocap_data / "c3d/02_03_runjog.c3d", tmp_path / "dance.c3d")
    for file in (mocap_data / "cmu/02").iterdir():
        shutil.copy(file, tmp_path)
    shutil.copy(find_library("thesis15"), tmp_path / "my.safetensors")
    shutil.copytree(mocap_data / "robots/robotis_op3", tmp_path, dirs_exist_ok=True)
    (tmp_path / "model.xml").write_text(humanoid())
    head = Path(__file__).parents[1] / "examples" / "head"
    shutil.copytree(head, tmp_path, dirs_exist_ok=True)
    look = read_clip(head / "look.toml")
    for name in ("look.csv", "talk.clip"):
        write_clip(look, tmp_path / name)
    writer = RecordingWriter(tmp_path / "run.rec", {"joints": ["pan"], "rate": 50.0}, {"targets": 1})
    writer.append(np.sin(np.arange(1000) / 50.0)[:, None])
    writer.close()
    shows = next(page for page in PAGES if page.name == "shows.md").read_text(encoding="utf-8")
    (tmp_path / "gala.toml").write_text(re.findall(r"^```toml\n(.*?)^```", shows, flags=re.M | re.S)[0])
    return tmp_path


@pytest.fixture
def run(folder):
    """Runs a command line in that folder, as this user alone."""
    children = []
    environment = os.environ | {"XDG_RUNTIME_DIR": str(folder), "HOME": str(folder), "MUJOCO_GL": "egl"}

    def start(line):
        words = [sys.executable, "-m", "motiondeck", *shlex.split(line)]
        child = subprocess.Popen(
            words, cwd=folder, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True,
        )  # fmt: skip
        children.append(child)
        return child

    yield start
    for child in children:
        child.kill()
        child.communicate()


def ended(child, codes=(0,)):
    """What a command printed that has ended well."""
    said, _ = child.communicate(timeout=500)
    assert child.returncode in codes, said
    assert "Traceback" not in said
    return said


def interrupted(child, seconds):
    """Lets a command go on for some seconds, in which it must not end, and ends it with Ctrl-C."""
    time.sleep(seconds)
    assert child.poll() is None, child.communicate()[0]
    child.send_signal(signal.SIGINT)
    return ended(child, (0, 130))


@pytest.mark.parametrize("line", [*lines()])
def test_it_does_what_the_page_says(line, run, folder):
    if "op3.toml" in line and "calibrate" not in line:
        ended(run("robot calibrate op3.xml --out op3.toml"))
    if (line.startswith("send ") and line != "send help") or line.startswith(("events", "stage")):
        rig = folder / "my-rig.toml"
        emulator = run("rig emulate servo20 --link rig-port")
        text = find_rig("servo20").read_text().replace("/dev/ttyUSB0", str(folder / "rig-port"))
        rig.write_text(f'on_loss = "go on"\n{text}')
        deck = run("play walk --robot servo20 --rig my-rig.toml --port 0")
        assert any(said.startswith("page: ") for said in deck.stdout)
        time.sleep(5.0)
        if "step" in line:
            ended(run("send pause"))
        if line.startswith(("events", "stage")):
            interrupted(run(line), 3.0)
        else:
            ended(run(line))
        assert emulator.poll() is None
        deck.send_signal(signal.SIGINT)
        ended(deck)
    elif FOR_EVER.match(line) and not re.search("--(headless|video|stop)", line):
        page = " --port 0" if line.startswith(("play", "clip view")) and "--port" not in line else ""
        interrupted(run(line + page), 10.0)
    else:
        judges = line.startswith(("preflight", "robot check"))  # 1 says that something does not pass
        ended(run(line), (0, 1) if judges else (0,))
