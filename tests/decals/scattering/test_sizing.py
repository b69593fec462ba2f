from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from blobtree import Point, Torus
from blobtree._typing import Float32Array, Float64Array, Int64Array
from decals import Relaxation, cover, measure
from decals.scattering import Orientation, gradient_of
from decals.scattering.covering import RADIUS_MARGIN, covering_radii
from decals.scattering.domain import OrientedPoints
from decals.scattering.neighbors import FacingTree
from decals.scattering.orientation import tangents
from decals.scattering.sizing import delaunay_radii, touching_radii
from decals.surfaces import ImplicitSurface
from tests.decals.meshes import plane


def flat(points: ArrayLike) -> OrientedPoints:
    points = np.asarray(points, np.float32)
    return OrientedPoints(
        points, np.tile(np.array([0, 0, 1], np.float32), (len(points), 1)), np.zeros(len(points), np.int32)
    )


def radii_on_plane(points: ArrayLike, size: float = 1.0, sample_count: int = 4000) -> Float64Array:
    surface = plane(size)

    def project(points: OrientedPoints) -> tuple[OrientedPoints, Int64Array]:
        rows = np.arange(len(points))
        return OrientedPoints(*surface.project(points.positions), points.surface_ids), rows

    samples = OrientedPoints(*surface.sample(sample_count, 1), np.zeros(sample_count, np.int32))
    return covering_radii(flat(points), samples, project, seed=0)


def test_covering_radius_of_one_decal() -> None:
    assert radii_on_plane([[-0.25, 0, 0]])[0] == pytest.approx(
        (1 + RADIUS_MARGIN) * np.hypot(0.75, 0.5), rel=0.01
    )


def test_covering_radius_of_a_hexagonal_tiling() -> None:
    rim_distance = np.sqrt(1 - 2 ** (-1 / 3))
    rows, columns = np.meshgrid(np.arange(-12, 13), np.arange(-12, 13), indexing="ij")
    points = np.stack([columns + 0.5 * (rows % 2), rows * np.sqrt(0.75), 0 * rows], axis=-1).reshape(-1, 3)
    radii = radii_on_plane(points, size=12.0, sample_count=20_000)
    inner = np.abs(points).max(axis=1) < 4
    assert radii[inner] / rim_distance == pytest.approx(
        np.full(inner.sum(), (1 + RADIUS_MARGIN) * 1.271), rel=0.01
    )


def test_a_warning_names_the_share_that_no_decal_faces(caplog: pytest.LogCaptureFixture) -> None:
    ball = Point((0, 0, 0), radius=1.0)
    covered = [measure(cover([ball], count=count), samples=20_000).coverage for count in (1, 3)]
    (message,) = caplog.messages
    share = float(message.partition(" %")[0]) / 100
    assert "none of the 1 decals faces them" in message
    assert abs(share + covered[0] - 1.0) < 0.02
    assert covered[1] == 1.0


def test_decals_that_own_no_sample_have_a_radius() -> None:
    radii = radii_on_plane([[0.0, 0.0, 0.0], [0.0, 0.0, 5.0]])
    assert radii[0] == pytest.approx((1 + RADIUS_MARGIN) * np.sqrt(0.5), rel=0.01)
    assert radii[1] == pytest.approx((1 + RADIUS_MARGIN) * 2.5, rel=0.01)
    assert (radii_on_plane(np.zeros((3, 3))) > 0).all()


def test_radii_are_deterministic() -> None:
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (40, 3)) * [1, 1, 0]
    assert radii_on_plane(points).tobytes() == radii_on_plane(points).tobytes()


def random_normals(count: int, seed: int = 0) -> Float32Array:
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    units: Float32Array = (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)
    return units


def is_tangent(vectors: Float32Array, normals: Float32Array) -> bool:
    return np.allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-6) and np.allclose(
        np.einsum("ni,ni->n", vectors, normals), 0, atol=1e-6
    )


def test_random_tangents() -> None:
    normals = np.tile(np.array([0, 0, 1], np.float32), (4000, 1))
    result = tangents(normals, normals, None, seed=1)
    assert is_tangent(result, normals)
    assert np.linalg.norm(result.mean(axis=0)) < 0.05
    assert result.tobytes() == tangents(normals, normals, None, seed=1).tobytes()
    assert result.tobytes() != tangents(normals, normals, None, seed=2).tobytes()


@pytest.mark.parametrize("length", [1e-200, 1.0, 1e200])
def test_tangents_follow_a_vector(length: float) -> None:
    normals = random_normals(200)
    result = tangents(normals, normals, (length, 0, 0), seed=0)
    assert is_tangent(result, normals)
    expected = [1, 0, 0] - normals[:, :1].astype(float) * normals
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.allclose(result, expected, atol=1e-5)


def test_tangents_follow_a_field() -> None:
    positions = random_normals(200)
    result = tangents(positions, positions, lambda points: np.cross([0, 0, 1], points), seed=0)
    assert is_tangent(result, positions)
    around = np.cross([0, 0, 1], positions)
    assert np.allclose(np.einsum("ni,ni->n", result, around), np.linalg.norm(around, axis=1), atol=1e-5)


@pytest.mark.parametrize("direction", [(0, 0, 0), (0, 0, 5.0), lambda points: np.zeros_like(points)])
def test_vanishing_direction_gives_a_fixed_tangent(direction: Any) -> None:
    normals = np.tile(np.array([0, 0, 1], np.float32), (5, 1))
    assert tangents(normals, normals, direction, seed=0).tolist() == [[1, 0, 0]] * 5


def test_tangents_of_no_decals() -> None:
    empty = np.zeros((0, 3), np.float32)
    for direction in (None, (1, 0, 0), lambda points: points):
        assert tangents(empty, empty, direction, seed=0).shape == (0, 3)


def torus() -> tuple[Float32Array, Float32Array, Float64Array]:
    """Points and normals of a torus, and the way around its tube."""
    angles = np.random.default_rng(0).uniform(0, 2 * np.pi, (1500, 2))
    (a, b) = angles.T
    normals = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=1)
    around = np.stack([-np.cos(a) * np.sin(b), -np.sin(a) * np.sin(b), np.cos(b)], axis=1)
    ring = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    return (ring + 0.3 * normals).astype(np.float32), normals.astype(np.float32), around


def test_tangents_follow_curvature() -> None:
    positions, normals, around = torus()
    result = tangents(positions, normals, Orientation.CURVATURE, seed=0)
    assert is_tangent(result, normals)
    assert np.quantile(np.abs(np.einsum("ni,ni->n", result, around)), 0.1) > 0.97


def test_cross_field_is_smooth() -> None:
    positions, normals, around = torus()
    result = tangents(positions, normals, Orientation.CROSS, seed=0)
    assert is_tangent(result, normals)
    turned = np.arccos(np.clip(np.einsum("ni,ni->n", result, around), -1, 1)) % (np.pi / 2)
    assert np.quantile(np.minimum(turned, np.pi / 2 - turned), 0.95) < np.radians(20)


def test_tangents_follow_a_gradient() -> None:
    normals = random_normals(200)
    result = tangents(normals, normals, gradient_of(lambda points: points[:, 2] ** 3), seed=0)
    assert is_tangent(result, normals)
    away = np.abs(normals[:, 2]) > 0.1
    assert np.allclose(result[away], tangents(normals, normals, (0, 0, 1), seed=0)[away], atol=1e-3)


@pytest.mark.parametrize("orientation", Orientation)
def test_tangents_of_few_decals(orientation: Orientation) -> None:
    for count in (0, 1, 2):
        normals = np.tile(np.array([0, 0, 1], np.float32), (count, 1))
        positions = np.arange(3 * count).reshape(-1, 3).astype(np.float32)
        result = tangents(positions, normals, orientation, seed=0)
        assert result.shape == (count, 3)
        assert count == 0 or is_tangent(result, normals)


def test_touching_radii() -> None:
    radii = touching_radii(flat([[0, 0, 0], [1, 0, 0], [3, 0, 0]]))
    assert radii.tolist() == [0.5, 0.5, 1.0]
    assert touching_radii(flat([[0, 0, 0]])).tolist() == [1.0]


def test_delaunay_radii() -> None:
    points = np.random.default_rng(4).uniform(-0.5, 0.5, (60, 3)) * [1, 1, 0]
    surface = plane(1.0)
    samples = OrientedPoints(*surface.sample(60_000, 1), np.zeros(60_000, np.int32))
    result = delaunay_radii(flat(points), samples) / np.sqrt(1 - 2 ** (-1 / 3))
    # pairs of points that own neighbouring pixels of a fine picture
    positions = (np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 500)] * 2, indexing="ij"), -1)).reshape(-1, 2)
    owner = cKDTree(points[:, :2]).query(positions)[1].reshape(500, 500)
    expected = np.zeros(60)
    for one, other in ((owner[1:], owner[:-1]), (owner[:, 1:], owner[:, :-1])):
        gaps = np.linalg.norm(points[one] - points[other], axis=-1)
        np.maximum.at(expected, one.ravel(), gaps.ravel())
        np.maximum.at(expected, other.ravel(), gaps.ravel())
    assert (np.abs(result - expected) < 1e-5).mean() > 0.85
    assert (result < expected + 1e-5).mean() > 0.95


@pytest.mark.parametrize("count", [60, 120])
def test_scraps_without_decals_are_not_searched_again_and_again(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    ring = Torus((0, 0, 0), (0.1, 0.2, 1), 1.35, radius=0.012)
    surface = ImplicitSurface(Point((0, 0, 0), radius=1.0) | ring, resolution=64)
    relaxation = Relaxation(surface, count=count, seed=1, iterations=20)
    searched, nearest = [], FacingTree.nearest_and_doubts

    def counted(tree: FacingTree, points: Float32Array, normals: Float32Array, **options: Any) -> Any:
        searched.append(len(points))
        return nearest(tree, points, normals, **options)

    monkeypatch.setattr("decals.scattering.rearrangement.PHASES", ())  # its rounds search all samples
    monkeypatch.setattr(FacingTree, "nearest_and_doubts", counted)
    relaxation.to_decals()
    assert sum(searched) < 800 * count
