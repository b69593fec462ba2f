import numpy as np
import pytest

from decals.orientation import tangents
from decals.population import Sites
from decals.sizing import MARGIN, covering_radii
from tests.decals.meshes import plane


def flat(points):
    points = np.asarray(points, np.float32)
    return Sites(points, np.tile(np.float32([0, 0, 1]), (len(points), 1)), np.zeros(len(points), np.int32))


def radii_on_plane(points, size=1.0, samples=4000):
    surface = plane(size)

    def project(sites):
        return Sites(*surface.project(sites.positions), sites.surface_ids)

    samples = Sites(*surface.sample(samples, 1), np.zeros(samples, np.int32))
    return covering_radii(flat(points), samples, project, seed=0)


def test_one_decal_reaches_the_far_corner_of_a_square():
    assert radii_on_plane([[-0.25, 0, 0]])[0] == pytest.approx((1 + MARGIN) * np.hypot(0.75, 0.5), rel=0.01)


def test_a_hexagonal_tiling_needs_1_271_times_its_spacing():
    rim = np.sqrt(1 - 2 ** (-1 / 3))
    rows, columns = np.meshgrid(np.arange(-12, 13), np.arange(-12, 13), indexing="ij")
    points = np.stack([columns + 0.5 * (rows % 2), rows * np.sqrt(0.75), 0 * rows], axis=-1).reshape(-1, 3)
    radii = radii_on_plane(points, size=12.0, samples=20_000)
    inner = np.abs(points).max(axis=1) < 4
    assert radii[inner] / rim == pytest.approx(np.full(inner.sum(), (1 + MARGIN) * 1.271), rel=0.01)


def test_a_decal_that_owns_nothing_has_a_size_all_the_same():
    radii = radii_on_plane([[0, 0, 0], [0, 0, 5.0]])
    assert radii[0] == pytest.approx((1 + MARGIN) * np.sqrt(0.5), rel=0.01)
    assert radii[1] == pytest.approx((1 + MARGIN) * 2.5, rel=0.01)
    assert (radii_on_plane(np.zeros((3, 3))) > 0).all()


def test_sizes_do_not_depend_on_chance_but_on_the_seed():
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (40, 3)) * [1, 1, 0]
    assert radii_on_plane(points).tobytes() == radii_on_plane(points).tobytes()


def normals_like(count, seed=0):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


def is_tangent(found, normals):
    return np.allclose(np.linalg.norm(found, axis=1), 1, atol=1e-6) and np.allclose(
        np.einsum("ni,ni->n", found, normals), 0, atol=1e-6
    )


def test_random_tangents_point_everywhere_and_repeat_for_a_seed():
    normals = np.tile(np.float32([0, 0, 1]), (4000, 1))
    found = tangents(normals, normals, None, seed=1)
    assert is_tangent(found, normals)
    assert np.linalg.norm(found.mean(axis=0)) < 0.05
    assert found.tobytes() == tangents(normals, normals, None, seed=1).tobytes()
    assert found.tobytes() != tangents(normals, normals, None, seed=2).tobytes()


@pytest.mark.parametrize("length", [1e-200, 1.0, 1e200])
def test_tangents_follow_a_vector(length):
    normals = normals_like(200)
    found = tangents(normals, normals, (length, 0, 0), seed=0)
    assert is_tangent(found, normals)
    expected = [1, 0, 0] - normals[:, :1].astype(float) * normals
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.allclose(found, expected, atol=1e-5)


def test_tangents_follow_a_field():
    positions = normals_like(200)
    found = tangents(positions, positions, lambda points: np.cross([0, 0, 1], points), seed=0)
    assert is_tangent(found, positions)
    around = np.cross([0, 0, 1], positions)
    assert np.allclose(np.einsum("ni,ni->n", found, around), np.linalg.norm(around, axis=1), atol=1e-5)


@pytest.mark.parametrize("direction", [(0, 0, 0), (0, 0, 5.0), lambda points: np.zeros_like(points)])
def test_a_direction_that_vanishes_leaves_a_stable_tangent(direction):
    normals = np.tile(np.float32([0, 0, 1]), (5, 1))
    assert tangents(normals, normals, direction, seed=0).tolist() == [[1, 0, 0]] * 5


def test_no_decals_have_no_tangents():
    none = np.zeros((0, 3), np.float32)
    for direction in (None, (1, 0, 0), lambda points: points):
        assert tangents(none, none, direction, seed=0).shape == (0, 3)
