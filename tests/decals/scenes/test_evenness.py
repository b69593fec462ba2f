"""Evenness, gaps and what contact keeps, against all pairs in float64 and closed forms."""

import math
from typing import Any

import numpy as np
import pytest

import decals
from decals import Relaxation
from decals.scattering.center_normals import Centers
from decals.scattering.neighbors import bond_orders
from decals.scenes.gaps import gap_widths
from decals.surfaces import MeshSurface
from tests.decals.fault_models import Arrays
from tests.decals.meshes import icosphere, plane
from tests.decals.thin_models import THIN_MODELS
from tests.oracles.evenness import evenness
from tests.oracles.evenness import gap_widths as exact_gap_widths

THICKNESSES = (0.2, 0.05, 0.01, 0.001)
COUNT, SEEDS = 120, (1,)


def scene_of(mesh: Arrays, layout: decals.Decals) -> decals.Scene:
    item = decals.MeshObject("model", *mesh)
    return decals.Scene(
        objects=[item], camera=decals.Camera.fitting(item.vertices), decals=layout, images=["eye"]
    )


def flat(positions: Any, radii: Any, **columns: Any) -> decals.Decals:
    count = len(positions)
    return decals.Decals(positions, [[0, 0, 1]] * count, [[1, 0, 0]] * count, radii, **columns)


def square(size: float) -> Arrays:
    surface = plane(size)
    return surface.vertices.astype(float), surface.faces


@pytest.mark.ordinary_cases("plate-0.05", "cone-0.01")
@pytest.mark.parametrize("thickness", THICKNESSES)
@pytest.mark.parametrize("name", THIN_MODELS)
def test_evenness_is_that_of_the_seeds_on_thin_models(name: str, thickness: float) -> None:
    """Decals that did not move, tilted at edges, have the evenness of their particles.

    A particle on an edge repels by the normal of one of its faces. Measures count both.
    """
    mesh = THIN_MODELS[name](thickness)
    for seed in SEEDS:
        relaxation = Relaxation(MeshSurface(*mesh), count=COUNT, seed=seed)
        relaxation.run()
        layout = relaxation.to_decals(sizing="touching")
        assert np.array_equal(layout.positions, relaxation.positions)
        found = scene_of(mesh, layout).measure(samples=2000)
        expected = evenness(relaxation.positions, relaxation.normals, 2.0 * relaxation.spacing)
        assert found.least_distance == pytest.approx(expected.least, rel=0.01)
        assert found.mean_distance == pytest.approx(expected.mean, rel=0.01)
        assert found.bond_order == pytest.approx(expected.bond_order, abs=0.1)
        assert found.rho == pytest.approx(relaxation.statistics().rho, rel=0.01)
        assert found.rho > 0.8


@pytest.mark.ordinary_cases("tube-0.05", "plate-0.05")
@pytest.mark.parametrize("thickness", THICKNESSES)
@pytest.mark.parametrize("name", THIN_MODELS)
def test_turned_decals_of_thin_models_are_no_neighbors_through_them(name: str, thickness: float) -> None:
    """Covering decals that moved keep 0.7 of a spacing, whatever their normals are."""
    mesh = THIN_MODELS[name](thickness)
    surface = MeshSurface(*mesh)
    for seed in SEEDS:
        layout = decals.scatter(surface, count=COUNT, seed=seed)
        found = scene_of(mesh, layout).measure(samples=2000)
        assert found.rho > 0.69
        assert found.least_distance == pytest.approx(found.decals.nearest.min())


def test_normals_of_a_thin_plate_are_those_of_its_faces() -> None:
    """Tilted decals on both sides of a plate, off its edges, and on its edges."""
    surface = MeshSurface(*THIN_MODELS["plate"](0.02))
    places = np.array([[0.3, 0.2, 0.01], [0.3, 0.2, -0.01], [1.0, 0.4, 0.01], [1.0, 0.4, 0.01]])
    tilted = [[0.9, 0, 1], [0.9, 0, -1], [0.4, 0, 1], [1, 0, 0.4]]
    layout = decals.Decals(places, tilted, [[0, 1, 0]] * 4, 0.1)
    expected = [[0, 0, 1], [0, 0, -1], [0, 0, 1], [1, 0, 0]]
    np.testing.assert_allclose(Centers.of(layout, [surface], 0.2).normals, expected, atol=1e-6)


def test_normals_of_open_sheets_and_of_the_nearest_surface() -> None:
    sheets = [plane(2.0), MeshSurface([[-1, -1, 1], [1, -1, 1], [1, 1, 1]], [[0, 2, 1]])]
    layout = decals.Decals(
        [[0.1, 0.2, 0.0], [0.1, 0.2, 0.0], [0.4, 0.1, 1.0]],
        [[0, 0.1, 1.0], [0, 0.1, -1.0], [0, 0, -1.0]],
        np.tile([1, 0, 0], (3, 1)),
        0.1,
    )
    np.testing.assert_allclose(
        Centers.of(layout, sheets, 0.2).normals, [[0, 0, 1], [0, 0, -1], [0, 0, -1]], atol=1e-6
    )
    assert len(Centers.of(decals.Decals.empty(), sheets, 1.0).normals) == 0


def test_bond_order_tells_a_lattice_from_random_points() -> None:
    rows = np.arange(-6, 7)
    hexagonal = np.array([(i + 0.5 * j, j * math.sqrt(0.75), 0.0) for i in rows for j in rows])
    rng = np.random.default_rng(1)
    random = rng.uniform(-6, 6, (400, 3)) * [1, 1, 0]
    layouts = (flat(hexagonal, 0.4), flat(random, 0.2))
    lattice, noise = (scene_of(square(16.0), layout).measure(samples=2000) for layout in layouts)
    inner = np.linalg.norm(hexagonal, axis=1) < 4
    np.testing.assert_allclose(lattice.decals.bond_order[inner], 1.0, atol=1e-5)
    for found, layout in zip((lattice, noise), layouts, strict=True):
        reach = 2.0 * math.sqrt(2.0 * 256 / (math.sqrt(3.0) * len(layout)))
        expected = evenness(layout.positions, layout.normals, reach)
        assert found.bond_order == pytest.approx(expected.bond_order, abs=1e-5)
        assert found.least_distance == pytest.approx(expected.least, rel=1e-5)
        assert found.mean_distance == pytest.approx(expected.mean, rel=1e-5)
    assert 0.3 < noise.bond_order < 0.45
    few = bond_orders(hexagonal[:3], np.tile([0, 0, 1], (3, 1)), np.full((3, 6), -1))
    assert np.isnan(few).all()


def test_bond_order_on_a_sphere_is_that_of_the_oracle() -> None:
    ball = MeshSurface(*icosphere(4))
    layout = decals.scatter(ball, count=COUNT, seed=3)
    found = scene_of(icosphere(4), layout).measure(samples=2000)
    expected = evenness(layout.positions, layout.normals, 2.0 * math.sqrt(8 * math.pi / math.sqrt(3) / COUNT))
    assert found.bond_order == pytest.approx(expected.bond_order, abs=0.01)
    assert found.rho > 0.85


@pytest.mark.parametrize("contact", ["product", "min", "radial", "elastic"])
def test_contact_keeps_the_discs_but_half_of_their_lens(contact: str) -> None:
    half = 0.6
    lens = 2 * math.acos(half) - 2 * half * math.sqrt(1 - half**2)
    layout = flat([[-half, 0, 0], [half, 0, 0]], 1.0)
    found = scene_of(square(4.0), layout).measure(contact=contact)
    np.testing.assert_allclose(found.decals.undeformed_area, math.pi, rtol=0.01)
    np.testing.assert_allclose(found.decals.kept, 1 - lens / 2 / math.pi, atol=0.005)
    assert found.kept == pytest.approx(1 - lens / 2 / math.pi, abs=0.003)
    assert (found.residual_overlap, found.decals.residual_overlap.max()) == (0, 0)
    over = scene_of(square(4.0), layout.replace(interactions="overlap")).measure(contact=contact)
    assert over.kept == 1
    assert over.residual_overlap == pytest.approx(lens, rel=0.03)
    np.testing.assert_allclose(over.decals.residual_overlap, lens, rtol=0.03)


def test_hidden_layers_keep_their_area_and_overlap() -> None:
    layout = flat([[0, 0, 0], [0.5, 0, 0], [0, 0, 0]], [1.0, 1.0, 0.5], layers=[0, 0, 1])
    found = scene_of(square(4.0), layout).measure(contact="product")
    half_lens = math.acos(0.25) - 0.25 * math.sqrt(1 - 0.25**2)
    share = 1 - half_lens / math.pi
    np.testing.assert_allclose(found.decals.kept, [share, share, 1], atol=0.005)
    assert found.residual_overlap == pytest.approx(0.25 * math.pi, rel=0.03)


def test_a_rounded_image_keeps_all_of_itself_on_a_ball() -> None:
    """The corrected mapping ends images inside their rims; that is no loss by contact."""
    layout = decals.Decals([[0, 0, 1], [0, 0, -1]], [[0, 0, 1], [0, 0, -1]], [[1, 0, 0]] * 2, 0.8)
    found = scene_of(icosphere(4), layout).measure()
    assert (found.kept, found.residual_overlap) == (1, 0)
    np.testing.assert_allclose(found.decals.undeformed_area, found.decals.visible_area)


def test_gaps_around_a_disc_in_a_square() -> None:
    found = scene_of(square(4.0), flat([[0, 0, 0]], 1.0)).measure(samples=200_000)
    ticks = (np.arange(2000) + 0.5) / 500 - 2
    widths = np.hypot(*np.meshgrid(ticks, ticks)).ravel() - 1
    widths = widths[widths > 0]
    assert found.gap_mean == pytest.approx(widths.mean(), rel=0.005)
    assert found.gap_cv == pytest.approx(widths.std() / widths.mean(), rel=0.01)
    assert found.gap_p95 == pytest.approx(np.percentile(widths, 95), rel=0.01)
    assert found.gap_max == pytest.approx(2 * math.sqrt(2) - 1, abs=0.02)
    assert found.covering_radius == pytest.approx(2 * math.sqrt(2), abs=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_gap_widths_of_discs_of_all_sizes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 300))
    centers = rng.uniform(-1, 1, (count, 3)) * [1, 1, 0]
    layout = flat(centers, 10 ** rng.uniform(-3.5, -0.7, count))
    points = (rng.uniform(-2, 2, (500, 3)) * [1, 1, 0]).astype(np.float32)
    expected = exact_gap_widths(points, layout.positions, layout.radii)
    up = np.tile(np.array([0, 0, 1], np.float32), (500, 1))
    np.testing.assert_allclose(gap_widths(layout, points, up), np.maximum(expected, 0), atol=1e-6)


def test_surface_that_no_decal_faces_has_straight_gaps() -> None:
    """One decal on a thin plate: the other side is bare, and its distance is finite."""
    mesh = THIN_MODELS["plate"](0.1)
    found = scene_of(mesh, flat([[0, 0, 0.05]], 0.2)).measure(samples=5000)
    assert found.gap_max == pytest.approx(math.hypot(math.sqrt(2), 0.1) - 0.2, abs=0.1)
    assert found.covering_radius == math.inf
    assert found.to_dict()["covering_radius"] is None
    none = scene_of(mesh, decals.Decals.empty()).measure(samples=500)
    assert math.isnan(none.gap_max)
    assert math.isnan(none.kept)
    assert math.isnan(none.covering_radius)
