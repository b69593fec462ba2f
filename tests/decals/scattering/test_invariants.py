"""Invariants of particles on any surface."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blobtree import Point, Segment
from blobtree._typing import Float32Array
from decals import Relaxation
from decals.scattering.neighbors import FacingTree
from decals.surfaces import ImplicitSurface, MeshSurface, Surface
from tests.decals.meshes import box, plane, sphere, star
from tests.oracles.triangles import closest_points


def blob() -> ImplicitSurface:
    return ImplicitSurface(Point((0, 0, 0), radius=1.0) + Segment((0.8, 0, 0), (2.2, 0, 0), radius=0.3))


def figure_eight() -> MeshSurface:
    """A closed strip that runs through itself."""
    turn = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    curve = np.stack([np.sin(turn), np.sin(2 * turn), 0 * turn], axis=1)
    vertices = np.concatenate([curve, curve])
    vertices[:80, 2], vertices[80:, 2] = -0.5, 0.5
    i, j = np.arange(80), np.roll(np.arange(80), -1)
    faces = np.concatenate([np.stack([i, j, j + 80], axis=1), np.stack([i, j + 80, i + 80], axis=1)])
    return MeshSurface(vertices, faces)


SURFACES: dict[str, Callable[[], Surface]] = {
    "star": star,
    "blob": blob,
    "thin wall": lambda: box((1.0, 1.0, 0.02)),
    "open": plane,
    "self-touching": figure_eight,
}


def distances_from(surface: Surface, positions: Float32Array) -> Any:
    """Distance of points from a surface; exact for small meshes."""
    if isinstance(surface, MeshSurface) and len(surface.faces) < 1000:
        return closest_points(positions, surface.vertices, surface.faces)
    return np.linalg.norm(surface.project(positions)[0] - positions, axis=1)


@pytest.mark.ordinary_cases("thin wall")
@pytest.mark.parametrize("name", SURFACES)
def test_particles_lie_on_the_surface_without_gaps(name: str) -> None:
    surface = SURFACES[name]()
    relaxation = Relaxation([surface], count=800)
    relaxation.run()
    positions, normals = relaxation.positions, relaxation.normals
    assert distances_from(surface, positions).max() < 1e-4 * relaxation.spacing
    # on an edge either face may lend its normal
    assert np.quantile(np.einsum("ni,ni->n", surface.normal(positions), normals), 0.1) > 0.9
    points, facing = surface.sample(8000, seed=9)
    gaps = FacingTree(positions, normals).nearest(points, facing)[0][:, 0]
    bare = gaps > 1.3 * relaxation.spacing
    # points of a thorn may face away from all particles around them
    assert bare.mean() < (0.003 if name == "star" else 1e-9)
    assert relaxation.statistics().rho > 0.8


def test_sides_of_a_thin_wall_are_independent() -> None:
    wall = box((1.0, 1.0, 0.02))
    both, alone = Relaxation([wall], count=400), Relaxation([plane()], count=192)
    both.run()
    alone.run()
    top = both.normals[:, 2] > 0.5
    assert top.sum() == pytest.approx(192, abs=10)
    assert np.allclose(both.positions[top, 2], 0.01, atol=1e-6)
    assert both.statistics().mean == pytest.approx(alone.statistics().mean, rel=0.1)


@pytest.mark.slow
def test_threads_do_not_change_the_bytes() -> None:
    first, again = (Relaxation([blob(), box()], count=1500, seed=5, iterations=12) for _ in range(2))
    first.run()
    again.run()
    assert first.positions.tobytes() == again.positions.tobytes()


RANDOM_SURFACES = given(
    number=st.integers(0, 10_000),
    count=st.integers(0, 60),
    fixed=st.integers(0, 3),
    parts=st.integers(1, 3),
    flat=st.booleans(),
)


@settings(max_examples=2)
@RANDOM_SURFACES
def test_random_surfaces_keep_the_invariants(
    number: int, count: int, fixed: int, parts: int, flat: bool
) -> None:
    check_random_surfaces(number, count, fixed, parts, flat)


@pytest.mark.slow
@settings(max_examples=30)
@RANDOM_SURFACES
def test_many_random_surfaces_keep_the_invariants(
    number: int, count: int, fixed: int, parts: int, flat: bool
) -> None:
    check_random_surfaces(number, count, fixed, parts, flat)


def check_random_surfaces(number: int, count: int, fixed: int, parts: int, flat: bool) -> None:
    rng = np.random.default_rng(number)
    surfaces = []
    for _ in range(parts):
        vertices = rng.normal(size=(12, 3)) * [1, 1, 0.0 if flat else 1]
        # some faces without area
        faces = np.concatenate([rng.permutation(12).reshape(-1, 3), [[0, 0, 1], [2, 3, 2]]])
        surfaces.append(MeshSurface(vertices, faces))
    relaxation = Relaxation(
        surfaces,
        count=count,
        seed=number,
        iterations=20,
        density=lambda points: 1.0 + np.abs(points[:, 0]),
        fixed=rng.normal(size=(min(fixed, count), 3)),
    )
    before = relaxation.positions[relaxation.fixed].copy()
    relaxation.run()
    assert relaxation.count == count
    assert np.array_equal(relaxation.positions[relaxation.fixed], before)
    assert np.isfinite(relaxation.positions).all()
    assert np.array_equal(relaxation.surface_ids, np.sort(relaxation.surface_ids))
    for index, surface in enumerate(surfaces):
        own = relaxation.positions[relaxation.surface_ids == index]
        gaps = closest_points(own, surface.vertices, surface.faces[:-2]) if len(own) else np.zeros(1)
        assert gaps.max() < 1e-4 * relaxation.spacing


def test_particles_closer_than_float32_resolves() -> None:
    far = MeshSurface(sphere(level=2).vertices * 1e-5 + 100.0, sphere(level=2).faces)
    relaxation = Relaxation([far], count=300, iterations=10)
    relaxation.run()
    assert np.isfinite(relaxation.positions).all()
    assert relaxation.count == 300
