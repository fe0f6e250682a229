import numpy as np
import pytest

from motiondeck.page.body.solids import box, creased, cylinder, sphere, thinned


def test_a_mesh_of_very_many_triangles_is_drawn_with_fewer_in_the_same_place():
    fine = sphere(100, 200)
    vertices, faces = thinned(fine, 1500)
    assert 700 < len(faces) <= 1500
    assert np.abs(np.linalg.norm(vertices, axis=1) - 1.0).max() < 0.02
    corners = vertices[faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == pytest.approx(4.0 * np.pi, rel=0.05)
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((outwards * corners.mean(axis=1)).sum(axis=1) > 0.0).all()
    small = sphere(4, 8)
    assert thinned(small, 1500) is small or np.array_equal(thinned(small, 1500)[1], small[1])


def shading(mesh):
    """The direction that a page shades each corner by: the mean of its triangles', by their area, shape (V, 3)."""
    vertices, faces = mesh
    sides = vertices[faces].astype(float)
    across = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    sums = np.zeros_like(vertices, dtype=float)
    for corner in range(3):
        np.add.at(sums, faces[:, corner], across)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def loose(mesh):
    """The same triangles, each with corners of its own, as in an STL file."""
    return mesh[0][mesh[1]].reshape(-1, 3), np.arange(3 * len(mesh[1]), dtype=np.uint32).reshape(-1, 3)


@pytest.mark.parametrize("file", [loose, lambda mesh: mesh], ids=["loose", "joined"])
def test_what_is_round_is_shaded_round_and_what_is_sharp_sharp(file):
    ball = creased(file(sphere(20, 40)))
    assert np.abs(shading(ball) - ball[0] / np.linalg.norm(ball[0], axis=1, keepdims=True)).max() < 0.1
    cube = creased(file(box()))
    assert np.sort(np.abs(shading(cube)), axis=1) == pytest.approx(np.tile([0.0, 0.0, 1.0], (24, 1)), abs=1e-6)
    # The lids of a drum are flat, its mantle is round.
    drum = creased(file(cylinder(24)))
    upright, level = np.abs(shading(drum)[:, 2]) > 0.99, np.abs(shading(drum)[:, 2]) < 0.01
    assert (upright | level).all()
    assert level.sum() == 2 * 24
    for mesh, made in ((sphere(20, 40), ball), (box(), cube), (cylinder(24), drum)):
        assert np.array_equal(made[0][made[1]], mesh[0][mesh[1]])


def test_triangles_without_an_area_and_sides_of_three_triangles_do_no_harm():
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, -1, 0)], dtype=np.float32)
    faces = np.array([(0, 1, 2), (0, 1, 3), (0, 1, 4), (0, 0, 1), (1, 1, 1)], dtype=np.uint32)
    made = creased((vertices, faces))
    assert np.array_equal(made[0][made[1]], vertices[faces])
