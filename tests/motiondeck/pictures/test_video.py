import os

import mujoco
import numpy as np
import pytest
from PIL import Image, ImageSequence

from motiondeck.pictures.offscreen import OffScreen, with_less_detail
from motiondeck.pictures.video import Shot, contact_sheet, render, screens
from motiondeck_base.errors import MotiondeckError
from sim.models.mannequin.mannequin import build_mannequin
from simulated_bodies import human

pytestmark = pytest.mark.smoke


@pytest.fixture(scope="module")
def model():
    """A mannequin, where there is OpenGL to draw it with."""
    built = build_mannequin(human()).compile()
    try:
        OffScreen(built, (16, 16)).close()
    except MotiondeckError as error:
        pytest.skip(str(error))
    return built


def standing(model, x=0.0):
    qpos = model.qpos0.copy()
    qpos[0] = x
    return qpos


def test_a_picture_shows_the_robot_and_the_camera_follows_it(model):
    with OffScreen(model, (120, 160)) as screen:
        here = screen.draw(standing(model))
        far = screen.draw(standing(model, x=40.0), cut=True)
    assert here.shape == (160, 120, 3)
    # The middle of the picture is the figure, the corners are not.
    assert np.abs(here[80, 60].astype(int) - here[5, 5]).max() > 20
    assert np.abs(here[40:120, 50:70].astype(int) - far[40:120, 50:70]).mean() < 12


def test_closing_twice_does_no_harm(model):
    screen = OffScreen(model, (16, 16))
    screen.close()
    screen.close()


@pytest.mark.parametrize("size", [(0, 10), (10, 5000)])
def test_an_impossible_size_is_refused(model, size):
    with pytest.raises(MotiondeckError, match="1920 x 1080"):
        OffScreen(model, size)


def test_a_gif_has_a_picture_a_frame_and_its_pace(model, tmp_path):
    seen = []
    frames = [standing(model, 0.2 * i) for i in range(4)]
    count = render(model, frames, tmp_path / "walk.gif", fps=20.0, size=(64, 80), progress=seen.append)
    assert count == 4
    assert seen == [1, 2, 3, 4]
    with Image.open(tmp_path / "walk.gif") as film:
        assert film.size == (64, 80)
        assert film.info["duration"] == 50
        assert len(list(ImageSequence.Iterator(film))) == 4
    assert [file.name for file in tmp_path.iterdir()] == ["walk.gif"]


@pytest.mark.thorough
def test_an_mp4_is_written_whole(model, tmp_path):
    pytest.importorskip("imageio_ffmpeg", reason="the extra 'video' is not installed")
    assert render(model, [standing(model)] * 3, tmp_path / "walk.mp4", size=(64, 64)) == 3
    assert (tmp_path / "walk.mp4").read_bytes()[4:8] == b"ftyp"
    assert [file.name for file in tmp_path.iterdir()] == ["walk.mp4"]


@pytest.mark.thorough
def test_a_film_that_breaks_leaves_nothing_behind(model, tmp_path):
    def frames():
        yield standing(model)
        raise ZeroDivisionError

    for name in ("a.gif", "a.mp4"):
        with pytest.raises(ZeroDivisionError):
            render(model, frames(), tmp_path / name, size=(32, 32))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["a.gif", "a.mp4"])
def test_a_film_of_nothing_is_refused(model, tmp_path, name):
    with pytest.raises(MotiondeckError, match="no frames"):
        render(model, [], tmp_path / name, size=(32, 32))
    assert list(tmp_path.iterdir()) == []


def test_other_endings_odd_sizes_and_missing_folders_are_refused(model, tmp_path):
    with pytest.raises(MotiondeckError, match=r"ends in \.mp4 or \.gif"):
        render(model, [standing(model)], tmp_path / "walk.avi")
    with pytest.raises(MotiondeckError, match="even width and height"):
        render(model, [standing(model)], tmp_path / "walk.mp4", size=(63, 64))
    with pytest.raises(MotiondeckError, match="there is no folder"):
        render(model, [standing(model)], tmp_path / "nowhere" / "walk.gif")


def test_without_ffmpeg_the_extra_is_named(model, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(MotiondeckError, match=r'pip install "motiondeck\[video\]"'):
        render(model, [standing(model)], tmp_path / "walk.mp4", size=(32, 32))


def test_without_opengl_the_packages_are_named(model, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setitem(__import__("sys").modules, "mujoco.egl", None)
    with pytest.raises(MotiondeckError, match=r"apt install libegl1 libgl1 libgl1-mesa-dri.*libosmesa6"):
        OffScreen(model, (16, 16))


def test_a_contact_sheet_has_a_row_a_motion(model, tmp_path):
    rows = [("stand", model, [standing(model)] * 8), ("lean", model, [standing(model, 0.1)] * 3)]
    contact_sheet(rows, tmp_path / "sheet.png", tile=(40, 50))
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.height == 100
        pixels = np.asarray(sheet.convert("L"), dtype=int)
    # Three pictures in the second row, then white; labels on the left of both.
    assert np.all(pixels[50:, -40:] == 255)
    assert np.any(pixels[:50, -40:] < 200)
    assert np.any(pixels[50:, :60] < 128)


def test_a_contact_sheet_of_nothing_or_of_another_kind_is_refused(model, tmp_path):
    with pytest.raises(MotiondeckError, match="no motions"):
        contact_sheet([], tmp_path / "sheet.png")
    with pytest.raises(MotiondeckError, match=r"ends in \.png"):
        contact_sheet([("x", model, [standing(model)])], tmp_path / "sheet.txt")


def test_a_film_that_is_killed_leaves_nothing_behind(model, tmp_path):
    def frames():
        yield standing(model)
        seen.extend(tmp_path.iterdir())

    seen: list = []
    render(model, frames(), tmp_path / "a.gif", size=(32, 32))
    if hasattr(os, "O_TMPFILE"):
        assert seen == []  # nothing has a name before all is done


def test_three_cameras_share_the_picture_and_see_different_sides(model):
    with OffScreen(model, (120, 80), camera="three") as screen:
        picture = screen.draw(standing(model)).astype(int)
    front, _, side = (picture[:, 40 * k : 40 * (k + 1)] for k in range(3))
    assert np.abs(front - side).max() > 30


def test_ghost_and_footprints_are_drawn(model):
    ahead = np.array([[0.3, -0.1, 0.0], [0.6, -0.1, 0.0], [0.6, 0.1, 0.0], [0.3, 0.1, 0.0]])
    with OffScreen(model, (120, 160)) as screen:
        plain = screen.draw(standing(model), cut=True).astype(int)
        printed = screen.draw(standing(model), cut=True, prints=[ahead]).astype(int)
        haunted = screen.draw(standing(model), cut=True, ghost=standing(model, x=0.4)).astype(int)
    assert np.abs(printed - plain).max() > 20
    assert np.abs(haunted - plain).max() > 20


def test_the_floor_is_not_over_exposed(model):
    with OffScreen(model, (160, 120)) as screen:
        picture = screen.draw(standing(model))
    below = picture[-20:].reshape(-1, 3).max(axis=1)
    assert np.quantile(below, 0.99) < 245
    assert np.quantile(below, 0.5) > 90


def test_all_of_two_bodies_far_apart_is_in_the_picture(model):
    spec = build_mannequin(human())
    other = build_mannequin(human())
    spec.attach(other, prefix="b/", frame=spec.worldbody.add_frame())
    both = spec.compile()
    qpos = both.qpos0.copy()
    qpos[both.nq // 2 + 1] = 3.0
    with OffScreen(both, (120, 120), camera="front") as screen:
        picture = screen.draw(qpos).astype(int)
    # Floor and sky are the same all along a row; hands that reach the edge are not.
    assert np.abs(picture[30:90, :3] - picture[30:90, 60:61]).max() < 60
    assert np.abs(picture[30:90, -3:] - picture[30:90, 60:61]).max() < 60


def test_meshes_lose_what_a_picture_cannot_show():
    spec = mujoco.MjSpec()
    angles = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    spec.add_mesh(name="disc", uservert=np.concatenate([ring, ring + 0.2 * np.eye(3)[2]]).ravel())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="disc")
    full = spec.compile()
    coarse = with_less_detail(full, 0.2)
    assert 8 < coarse.mesh_facenum[0] < 0.3 * full.mesh_facenum[0]
    used = np.unique(coarse.mesh_face[: coarse.mesh_facenum[0]])
    assert np.ptp(coarse.mesh_vert[used], axis=0) == pytest.approx(np.ptp(full.mesh_vert, axis=0), abs=0.2)
    assert len(full.mesh_face) == full.mesh_facenum[0]


@pytest.mark.thorough
def test_screens_that_share_a_film_draw_the_same_pictures(model, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    shots = [Shot(standing(model, 0.2 * k), ghost=standing(model) if k == 3 else None) for k in range(5)]
    with OffScreen(model, (120, 90)) as screen:
        expected = [screen.draw(shot.qpos, ghost=shot.ghost) for shot in shots]
    with screens(model, (120, 90), False, "follow") as draw:
        drawn = list(draw(shots))
    drawn, expected = np.array(drawn, dtype=int), np.array(expected, dtype=int)
    assert np.abs(drawn - expected).max() <= 1  # as OpenGL rounds
    assert np.abs(expected[1] - expected[0]).max() > 50
