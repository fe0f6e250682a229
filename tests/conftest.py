"""What all tests share: recordings, a browser, hypothesis examples that stay the same, and no silent skips in CI."""

import gc
import os
import re
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, settings

from waiting import PATIENCE

# Each worker has one core; said before numpy is imported, as the program itself does.
for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# Programs that tests start find our modules compiled, as at a user's, instead of compiling 300 of them anew each time;
# and the next run of the tests finds the tests compiled.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

settings.register_profile(
    "motiondeck",
    derandomize=True,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("motiondeck")


class FrozenAfterCollection:
    """Keeps a full garbage collection from visiting again, test after test, all modules and tests of a worker.

    Each run of the loop collects once, and 280,000 objects take it longer than most tests do. What survives such a
    collection is frozen when the test is over.
    """

    def __init__(self):
        self._collected = True
        gc.callbacks.append(self._look)

    def _look(self, phase, info):
        self._collected |= phase == "stop" and info["generation"] == 2

    def pytest_runtest_logfinish(self):
        if self._collected:
            gc.freeze()
            self._collected = False


def pytest_configure(config):
    config.pluginmanager.register(FrozenAfterCollection())


@pytest.fixture(scope="session", autouse=True)
def _nothing_kept(tmp_path_factory):
    """No verdict and no walk that was kept by an earlier program is found; what others keep there (fonts) is."""
    before = os.environ.get("XDG_CACHE_HOME")
    kept, new = Path(before or Path.home() / ".cache"), tmp_path_factory.mktemp("cache")
    for each in kept.iterdir() if kept.is_dir() else ():
        if each.name != "motiondeck":
            (new / each.name).symlink_to(each)
    os.environ["XDG_CACHE_HOME"] = str(new)
    yield
    os.environ.pop("XDG_CACHE_HOME") if before is None else os.environ.update(XDG_CACHE_HOME=before)


@cache
def has_browser_tests(file):
    """Whether a test or a fixture of this file takes the fixture `browser`."""
    return re.search(r"def \w+\([^)]*\bbrowser\b", Path(file).read_text(encoding="utf-8")) is not None


def pytest_collection_modifyitems(items):
    """What waits comes first: browsers, then whole programs. What computes fills the gaps, and no wait is left over."""
    items.sort(key=lambda item: (not has_browser_tests(item.path), not item.nodeid.startswith(PROGRAMS)))
    # A click on a page that is still laid out gets lost now and then, and on the machines of CI other programs take a
    # core for seconds. A second attempt is named in the summary. What may have one takes 20 ms longer.
    for item in items:
        in_ci = "MOTIONDECK_ALL_TESTS" in os.environ and item.get_closest_marker("thorough") is not None
        if "browser" in item.fixturenames or in_ci:
            item.add_marker(pytest.mark.flaky(reruns=1))


PROGRAMS = ("tests/motiondeck/",)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Hands out whole files, all those with a browser to one worker: two that draw in software slow each other down.

    The second worker runs programs as long as there are any, which mostly wait; the third computes.
    """
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class OneOfEach(LoadFileScheduling):
        def _split_scope(self, nodeid):
            file = super()._split_scope(nodeid)
            return "with a browser" if has_browser_tests(config.rootpath / file) else file

        def _assign_work_unit(self, node):
            kind = min(self.nodes.index(node), 2)
            preferred = next((file for file in self.workqueue if kind == self._kind(file)), None)
            if preferred is not None:
                self.workqueue.move_to_end(preferred, last=False)
            super()._assign_work_unit(node)

        def _kind(self, file):
            return 0 if file == "with a browser" else 1 if file.startswith(PROGRAMS) else 2

    config.option.loadscopereorder = False
    return OneOfEach(config, log)


@pytest.fixture(scope="module", autouse=True)
def runtime_folder():
    """A folder for the command sockets of each file's decks, so that no other deck of this user is met.

    The path is short, since that of a Unix socket has 108 bytes at most.
    """
    with tempfile.TemporaryDirectory(prefix="run-") as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", folder)
        yield Path(folder)


HASTE = {"command_socket._STOPPED_WITHIN": 0.5, "local_connection._STOP_PATIENCE": 0.2}  # s


@pytest.fixture(scope="session", autouse=True)
def _patient_clients():
    """Clients in tests wait long for a deck: it may be a thread or a process that gets no core for a while."""
    from controller.wire.command_socket import DEFAULT_PORT, CommandClient

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CommandClient.__init__, "__defaults__", (DEFAULT_PORT, None, None, PATIENCE))
        patch.setattr(CommandClient.request, "__defaults__", (PATIENCE,))
        for name in (*HASTE, "network_transport._ANSWERS_WITHIN"):
            patch.setattr(f"controller.wire.{name}", PATIENCE)
        yield


@pytest.fixture
def hasty(monkeypatch):
    """Clients that wait for an emergency stop as long as those of a user."""
    for name, seconds in HASTE.items():
        monkeypatch.setattr(f"controller.wire.{name}", seconds)


RECORDINGS = Path(os.environ.get("MOTIONDECK_DATA") or Path(__file__).parents[2] / "shared" / "data")


@pytest.fixture(scope="session")
def mocap_data() -> Path:
    """The folder of real recordings: MOTIONDECK_DATA, or shared/data beside the repository."""
    if not RECORDINGS.is_dir():
        pytest.skip(f"there is no folder {RECORDINGS}: set MOTIONDECK_DATA to one with recordings")
    return RECORDINGS


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium, where one is installed and can be started."""
    playwright = pytest.importorskip("playwright.sync_api")
    names = ("chromium", "chromium-browser", "google-chrome")
    installed = next(filter(None, map(shutil.which, names)), None)
    if installed is None:
        pytest.skip("no Chromium is installed (Debian: apt-get install chromium)")
    # Only WebGL is drawn by SwiftShader: with the page put together by it as well, a picture costs four times as much.
    graphics = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
    playwright.expect.set_options(timeout=1000.0 * PATIENCE)
    try:
        driver = playwright.sync_playwright().start()
    except Exception as error:  # whatever keeps a foreign process from starting, e.g. no libatomic1
        pytest.skip(f"the browser's driver does not start: {str(error).splitlines()[0]}")
    try:
        try:
            chromium = driver.chromium.launch(executable_path=installed, args=graphics)
        except playwright.Error as error:
            pytest.skip(f"the browser does not start: {str(error).splitlines()[0]}")
        yield SimpleNamespace(new_page=lambda **options: _drawn_seldom(chromium.new_page(**options)))
        chromium.close()
    finally:
        driver.stop()


def _drawn_seldom(page):
    """A page that draws eight pictures a second: in software one costs 50 ms, and a core draws all the time."""
    page.add_init_script(
        """const draw = window.requestAnimationFrame.bind(window);
        window.requestAnimationFrame = (picture) => setTimeout(() => draw(picture), 120);
        window.cancelAnimationFrame = clearTimeout;"""
    )
    page.set_default_timeout(60_000)  # ms
    return page


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """With MOTIONDECK_ALL_TESTS set, as in CI, a test that skips itself fails; only recordings may be missing."""
    report = yield
    lacks_recordings = "mocap_data" in item.fixturenames and not RECORDINGS.is_dir()
    meant = item.get_closest_marker("skipif") is not None or hasattr(report, "wasxfail")
    if report.skipped and "MOTIONDECK_ALL_TESTS" in os.environ and not lacks_recordings and not meant:
        report.outcome = "failed"
        report.longrepr = f"skipped, but MOTIONDECK_ALL_TESTS is set: {report.longrepr[2]}"
    return report
