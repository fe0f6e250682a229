import time

import numpy as np
import pytest

from controller.networks.orbits import orbits
from motiondeck.page.network.network_view import REACH, InnerLife, NetworkView
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.private_page import PrivatePage
from motiondeck_base.shipped import find_library
from shipped_libraries import shipped
from waiting import free_port

HEIGHT = 1.8


@pytest.fixture
def page():
    page = PrivatePage(free_port(), label="test")
    yield page
    page.stop()


def look(view, activation, motion, seconds):
    """Shows the network until it is drawn, for so long at most."""
    deadline = time.monotonic() + seconds
    while view.ball is None and time.monotonic() < deadline:
        view.show(activation, motion, 0.25, visible=True)
        time.sleep(0.02)
    view.show(activation, motion, 0.25, visible=True)


def test_the_ball_is_where_the_neurons_are(page):
    library = shipped()
    network = library.network.twin()
    network.cue("waltz", 3)
    network.advance(np.zeros(network.channels))
    view = NetworkView(PageParts(page), find_library("thesis15"), HEIGHT)
    view.show(network.activation, "waltz", 0.25, visible=False)
    assert view.ball is None
    look(view, network.activation, "waltz", 30.0)
    waltz = orbits(network, {motion.name: motion.frames for motion in library.info.motions}).paths["waltz"]
    # Signs of principal components are free, and so are those of the ball's coordinates.
    apart = np.abs(np.abs(REACH * HEIGHT * waltz) - np.abs(view.ball)).max(1)
    assert apart.min() < 0.03 * HEIGHT


@pytest.mark.parametrize(("library", "motion", "centers"), [("thesis15", "walk", 1), ("cmu86", "walk", 2)])
def test_the_centers_turn_with_the_motion(library, motion, centers):
    inside = InnerLife.of(find_library(library))
    begins, later, ends = (np.array(inside.centers(motion, phase)) for phase in (0.0, 0.3, 1.0))
    assert len(begins) == centers
    assert ((later - begins) % 1.0 > 0.1).all()
    apart = np.abs(ends - begins)
    assert np.minimum(apart, 1.0 - apart)[0] < 0.01  # the slowest center of a loop comes back to where it was
    assert inside.centers("none", 0.0) == inside.centers(motion, None) == []


def test_a_library_that_has_been_replaced_by_one_with_other_neurons_shows_nothing(page):
    view = NetworkView(PageParts(page), find_library("thesis15"), HEIGHT)
    look(view, np.zeros(10), "walk", 3.0)
    assert view.ball is None


def test_a_library_that_has_gone_shows_nothing(page, tmp_path):
    view = NetworkView(PageParts(page), tmp_path / "none.safetensors", HEIGHT)
    look(view, np.zeros(10), "walk", 0.3)
    assert view.ball is None
