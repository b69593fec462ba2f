import numpy as np
import pytest

from decals.coat.fields import gradient_of
from decals.coat.orientation import Orientation, tangents
from decals.coat.sizing import MARGIN, covering_radii, delaunay_radii, touching_radii
from decals.seeds.population import Sites
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


def torus():
    """Points and normals of a torus, and the way around its tube."""
    angles = np.random.default_rng(0).uniform(0, 2 * np.pi, (1500, 2))
    (a, b) = angles.T
    normals = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=1)
    around = np.stack([-np.cos(a) * np.sin(b), -np.sin(a) * np.sin(b), np.cos(b)], axis=1)
    ring = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    return (ring + 0.3 * normals).astype(np.float32), normals.astype(np.float32), around


def test_tangents_follow_the_curvature_around_a_tube():
    positions, normals, around = torus()
    found = tangents(positions, normals, Orientation.CURVATURE, seed=0)
    assert is_tangent(found, normals)
    assert np.quantile(np.abs(np.einsum("ni,ni->n", found, around)), 0.1) > 0.97


def test_a_cross_field_agrees_with_its_neighbours_up_to_quarter_turns():
    positions, normals, around = torus()
    found = tangents(positions, normals, Orientation.CROSS, seed=0)
    assert is_tangent(found, normals)
    turned = np.arccos(np.clip(np.einsum("ni,ni->n", found, around), -1, 1)) % (np.pi / 2)
    assert np.quantile(np.minimum(turned, np.pi / 2 - turned), 0.95) < np.radians(20)


def test_tangents_follow_a_gradient():
    normals = normals_like(200)
    found = tangents(normals, normals, gradient_of(lambda points: points[:, 2] ** 3), seed=0)
    assert is_tangent(found, normals)
    away = np.abs(normals[:, 2]) > 0.1
    assert np.allclose(found[away], tangents(normals, normals, (0, 0, 1), seed=0)[away], atol=1e-3)


@pytest.mark.parametrize("orientation", Orientation)
def test_few_decals_have_tangents_too(orientation):
    for count in (0, 1, 2):
        normals = np.tile(np.float32([0, 0, 1]), (count, 1))
        places = np.arange(3 * count).reshape(-1, 3).astype(np.float32)
        found = tangents(places, normals, orientation, seed=0)
        assert found.shape == (count, 3)
        assert count == 0 or is_tangent(found, normals)


def test_touching_decals_share_half_the_gap():
    radii = touching_radii(flat([[0, 0, 0], [1, 0, 0], [3, 0, 0]]))
    assert radii.tolist() == [0.5, 0.5, 1.0]
    assert touching_radii(flat([[0, 0, 0]])).tolist() == [1.0]


def test_the_papers_rule_reaches_to_the_farthest_delaunay_neighbour():
    points = np.random.default_rng(4).uniform(-0.5, 0.5, (60, 3)) * [1, 1, 0]
    surface = plane(1.0)
    samples = Sites(*surface.sample(60_000, 1), np.zeros(60_000, np.int32))
    found = delaunay_radii(flat(points), samples) / np.sqrt(1 - 2 ** (-1 / 3))
    # brute force: pairs of points that own neighbouring pixels of a fine picture
    places = (np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 500)] * 2, indexing="ij"), -1)).reshape(-1, 2)
    owner = np.linalg.norm(places[:, None] - points[None, :, :2], axis=2).argmin(axis=1).reshape(500, 500)
    expected = np.zeros(60)
    for one, other in ((owner[1:], owner[:-1]), (owner[:, 1:], owner[:, :-1])):
        gaps = np.linalg.norm(points[one] - points[other], axis=-1)
        np.maximum.at(expected, one.ravel(), gaps.ravel())
        np.maximum.at(expected, other.ravel(), gaps.ravel())
    assert (np.abs(found - expected) < 1e-5).mean() > 0.85
    assert (found < expected + 1e-5).mean() > 0.95
