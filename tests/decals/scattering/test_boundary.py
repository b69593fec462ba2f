"""Open boundaries repel particles like a mirror."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from blobtree._typing import Float32Array, Float64Array
from decals import Relaxation, scatter
from decals.model import FACING_LIMIT
from decals.scattering import Creases
from decals.scattering.boundary import Boundary
from decals.scattering.boundary_kernels import PLANES_PER_POINT
from decals.scattering.repulsion import CORE, CUTOFF, DAMPING, MAX_MOVE, Law
from decals.scattering.repulsion_kernels import CLOSEST, ISOTROPY, MAX_RING_DEVIATION, MIRROR_DEPTH
from decals.scattering.search_kernels import MirrorPlanes
from decals.surfaces import MeshSurface
from tests.decals.meshes import box, plane, sphere
from tests.decals.scattering.evaluation import device_particles, evaluate
from tests.oracles.repulsion import moves as expected_moves
from tests.oracles.repulsion import ring_energy, rings, total_energy
from tests.oracles.triangles import closest_points

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
UP = np.array([0, 0, 1], np.float32)


def disc(corners: int = 200) -> MeshSurface:
    turn = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    around = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    faces = [[0, 1 + i, 1 + (i + 1) % corners] for i in range(corners)]
    return MeshSurface(np.vstack([[0, 0, 0], around]), faces)


def half_ball(rings: int = 48, corners: int = 160) -> MeshSurface:
    """The upper half of a unit ball, its boundary on z = 0."""
    away, turn = np.linspace(0, np.pi / 2, rings), np.linspace(0, 2 * np.pi, corners, endpoint=False)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rows = [np.column_stack([np.sin(a) * around, np.full(corners, np.cos(a))]) for a in away]
    here = np.arange(rings * corners).reshape(rings, corners)
    one, other = here[:-1], here[1:]
    after, beyond = np.roll(one, -1, axis=1), np.roll(other, -1, axis=1)
    faces = np.concatenate(
        [np.stack(f, axis=-1).reshape(-1, 3) for f in ((one, other, beyond), (one, beyond, after))]
    )
    return MeshSurface(np.concatenate(rows), faces)


def cell_areas(relaxation: Relaxation) -> Float64Array:
    """Area nearest to each particle, in its fair share."""
    samples, _ = relaxation.domain.surfaces[0].sample(60 * relaxation.count, seed=8)
    near = cKDTree(relaxation.positions).query(samples)[1]
    return np.bincount(near, minlength=relaxation.count) / 60


MODELS: dict[str, tuple[Callable[[], MeshSurface], Callable[[Float32Array], Any]]] = {
    "disc": (disc, lambda p: 1 - np.hypot(p[:, 0], p[:, 1])),
    "square": (lambda: plane(2.0), lambda p: 1 - np.abs(p[:, :2]).max(axis=1)),
    "half ball": (half_ball, lambda p: np.arcsin(np.clip(np.abs(p[:, 2]), 0, 1))),
}


@pytest.mark.slow_cases("half ball-900", "disc-900", "square-900")
@pytest.mark.parametrize("count", [400, 900])
@pytest.mark.parametrize("name", list(MODELS))
def test_boundary_particles_have_the_same_area_as_others(name: str, count: int) -> None:
    make, depth_of = MODELS[name]
    relaxation = Relaxation([make()], count=count)
    relaxation.run()
    depth = depth_of(relaxation.positions) / relaxation.spacing
    areas = cell_areas(relaxation)
    outer, inner = depth < 0.7, depth > 2.5
    assert areas[outer].mean() == pytest.approx(1.0, abs=0.08)
    assert areas[inner].mean() == pytest.approx(1.0, abs=0.015)
    assert depth.min() > 0.4
    assert np.median(depth[outer]) < 0.62
    assert relaxation.statistics().rho > 0.88


def half_plane(count: int, seed: int) -> Float32Array:
    """Particles over the half plane x > 0, all farther from the boundary than the mirror depth."""
    rng = np.random.default_rng(seed)
    positions = np.zeros((count, 3), np.float32)
    positions[:, 0] = rng.uniform(1.05 * MIRROR_DEPTH, 4.0, count)
    positions[:, 1] = rng.uniform(-2.0, 2.0, count)
    return positions


def evaluated(
    positions: Float32Array, law: Law, device: str
) -> tuple[Float32Array, Float32Array, Float64Array]:
    """Moves, energies and pair energies of particles beside the mirror plane x = 0."""
    count = len(positions)
    particles = device_particles(positions, np.tile(UP, (count, 1)), np.ones(count), device)
    normals = np.zeros((PLANES_PER_POINT * count, 3), np.float32)
    normals[::PLANES_PER_POINT, 0] = 1.0
    mirrors: Any = MirrorPlanes()
    mirrors.per_point = PLANES_PER_POINT
    mirrors.points = wp.zeros(PLANES_PER_POINT * count, dtype=wp.vec3, device=device)
    mirrors.normals = wp.array(normals, dtype=wp.vec3, device=device)
    return evaluate(particles, law, mirrors, varied=False, device=device)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("stiffness", [0.0, 300.0])
def test_step_at_mirror_plane_matches_oracle(stiffness: float, device: str) -> None:
    positions = half_plane(40, seed=3)
    normals, sizes = np.tile(UP, (40, 1)), np.ones(40)
    rule: dict[str, Any] = {"cutoff": CUTOFF, "core": CORE, "stiffness": stiffness}
    rule |= {"facing_limit": FACING_LIMIT, "closest": CLOSEST}
    moves, energies, pair_energies = evaluated(positions, Law(stiffness), device)
    step: dict[str, Any] = {"damping": DAMPING, "longest": MAX_MOVE, "isotropy": ISOTROPY}
    wall = np.zeros(3), np.array([1.0, 0, 0])
    expected, expected_energies = expected_moves(positions, normals, sizes, **rule, **step, wall=wall)
    assert np.allclose(moves, expected, atol=2e-4)
    assert np.allclose(energies, expected_energies, rtol=1e-3)
    # what lies on both sides of a mirror has twice the energy of one side
    both = np.concatenate([positions, positions * np.array([-1, 1, 1], np.float32)])
    whole = total_energy(both, np.tile(UP, (80, 1)), np.ones(80), **rule)
    assert pair_energies.sum() == pytest.approx(0.5 * whole, rel=1e-4)


@pytest.mark.parametrize("device", DEVICES)
def test_ring_terms_at_mirror_plane_match_oracle(device: str) -> None:
    positions = half_plane(40, seed=5)
    normals, sizes = np.tile(UP, (40, 1)), np.ones(40)
    law = Law(300.0, 600.0)
    moves, energies, pair_energies = evaluated(positions, law, device)
    wall = np.zeros(3), np.array([1.0, 0, 0])
    around: dict[str, Any] = {"farthest": CUTOFF, "facing_limit": FACING_LIMIT}
    mean = rings(positions, normals, sizes, **around, wall=wall)[0].mean()
    rule: dict[str, Any] = {"cutoff": CUTOFF, "core": CORE, "stiffness": law.stiffness}
    rule |= {"facing_limit": FACING_LIMIT, "closest": CLOSEST}
    step: dict[str, Any] = {
        "damping": DAMPING,
        "longest": MAX_MOVE,
        "isotropy": ISOTROPY,
        "ring_weight": law.ring_weight,
        "mean": mean,
        "max_deviation": MAX_RING_DEVIATION,
    }
    expected, expected_energies = expected_moves(positions, normals, sizes, **rule, **step, wall=wall)
    assert np.allclose(moves, expected, atol=2e-4)
    assert np.allclose(energies, expected_energies, rtol=1e-3)
    both = np.concatenate([positions, positions * np.array([-1, 1, 1], np.float32)])
    normals, ones = np.tile(UP, (80, 1)), np.ones(80)
    whole = total_energy(both, normals, ones, **rule)
    whole += ring_energy(
        both,
        normals,
        ones,
        ring_weight=law.ring_weight,
        mean=mean,
        max_deviation=MAX_RING_DEVIATION,
        **around,
    )
    assert pair_energies.sum() == pytest.approx(0.5 * whole, rel=1e-4)


def planes_of(
    surfaces: Sequence[MeshSurface],
    points: Any,
    *,
    spacing: float = 0.1,
    enabled: Sequence[int] | None = None,
    surface_ids: Sequence[int] | None = None,
) -> Float32Array:
    """Normals of the mirror planes of points on surfaces, ``[n, PLANES_PER_POINT, 3]``."""
    count = len(points)
    ids = [0] * count if surface_ids is None else surface_ids
    normals = [surfaces[index].project([point])[1][0] for index, point in zip(ids, points, strict=True)]
    particles = device_particles(points, normals, np.full(count, spacing), "cpu")
    flags = [1] * count if enabled is None else enabled
    columns: list[Any] = [
        wp.array(np.array(values, np.int32), dtype=wp.int32, device="cpu") for values in (ids, flags)
    ]
    mirrors: Any = Boundary(surfaces, spacing, "cpu").mirror_planes(particles, *columns, reach=CUTOFF)
    planes: Float32Array = mirrors.normals.numpy().reshape(count, -1, 3)
    return planes


def test_mirror_planes_lie_at_the_boundary() -> None:
    points = [[0.45, 0.0, 0.0], [0.0, 0.0, 0.0], [0.45, 0.48, 0.0], [0.5, 0.1, 0.0]]
    planes = planes_of([plane()], points)
    assert planes[0] == pytest.approx(np.array([[-1, 0, 0], [0, 0, 0]]), abs=1e-6)
    assert not planes[1].any()  # too far from all boundaries
    assert planes[2] == pytest.approx(np.array([[0, -1, 0], [-1, 0, 0]]), abs=1e-6)  # the nearer one first
    assert planes[3, 0] == pytest.approx([-1, 0, 0], abs=1e-6)  # on the boundary itself
    assert not planes_of([plane()], points, enabled=[0] * 4).any()


def test_no_mirror_planes_where_a_surface_continues() -> None:
    assert Boundary([sphere(), box()], 0.1, "cpu").count == 0
    left, right = plane(), MeshSurface(plane().vertices + np.array([1, 0, 0], np.float32), plane().faces)
    planes = planes_of([left, right], [[0.45, 0.0, 0], [0.55, 0, 0], [-0.45, 0, 0]], surface_ids=[0, 1, 0])
    assert not planes[:2].any()
    assert planes[2, 0] == pytest.approx([1, 0, 0], abs=1e-6)
    floor = MeshSurface(plane(4.0).vertices, plane().faces)
    upright = MeshSurface([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]])
    planes = planes_of([upright, floor], [[0.5, 0.0, 0.05], [0.5, 0, 0.95]])
    assert not planes[0].any()
    assert planes[1, 0] == pytest.approx([0, 0, -1], abs=1e-6)


def test_boundary_of_another_surface_is_ignored() -> None:
    table, card = (
        plane(4.0),
        MeshSurface(plane().vertices + np.array([0, 0, 0.02], np.float32), plane().faces),
    )
    assert not planes_of([table, card], [[0.45, 0.0, 0]]).any()


def test_unwelded_faces_have_no_boundary() -> None:
    ball = sphere(level=3)
    soup = MeshSurface(ball.vertices[ball.faces.reshape(-1)] * 1.0, np.arange(ball.faces.size).reshape(-1, 3))
    rng = np.random.default_rng(0)
    shaken = MeshSurface(soup.vertices + rng.normal(0, 2e-4, soup.vertices.shape), soup.faces)
    assert not shaken.closed
    assert Boundary([shaken], 0.2, "cpu").count == 0
    relaxation = Relaxation([shaken], count=300)
    relaxation.run()
    assert relaxation.statistics().rho > 0.85


def test_seam_of_two_patches_is_no_boundary() -> None:
    whole = plane(2.0)
    parts = [
        MeshSurface([[x, -1, 0], [x + 1, -1, 0], [x + 1, 1, 0], [x, 1, 0]], whole.faces) for x in (-1, 0)
    ]
    relaxation = Relaxation(parts, count=1000)
    relaxation.run()
    across = np.abs(relaxation.positions[:, 0])
    # particles do not keep away from the seam
    assert across.min() < 0.25 * relaxation.spacing
    strip = 3.0 * relaxation.spacing
    assert (across < strip).sum() == pytest.approx(1000 * strip, rel=0.05)


def test_fixed_particles_on_the_boundary_stay_there() -> None:
    square = plane(2.0)
    spacing = 0.1
    points = Creases(square).points(spacing)
    decals = scatter(square, spacing=spacing, fixed=points)
    gaps, _ = cKDTree(decals.positions).query(points)
    assert gaps.max() < 1e-6
    depth = 1 - np.abs(decals.positions[:, :2]).max(axis=1)
    second = depth[(depth > 1e-6) & (depth < 1.4 * spacing)]
    assert np.median(second) == pytest.approx(np.sqrt(0.75) * spacing, rel=0.15)


RANDOM_STRIPS = given(
    number=st.integers(0, 10_000), count=st.integers(1, 80), scale=st.sampled_from([1e-3, 1.0, 1e3])
)


@settings(max_examples=2)
@RANDOM_STRIPS
def test_random_strips_and_fans_keep_the_invariants(number: int, count: int, scale: float) -> None:
    check_strip_and_fan(number, count, scale)


@pytest.mark.slow
@settings(max_examples=12)
@RANDOM_STRIPS
def test_many_random_strips_and_fans_keep_the_invariants(number: int, count: int, scale: float) -> None:
    check_strip_and_fan(number, count, scale)


def check_strip_and_fan(number: int, count: int, scale: float) -> None:
    """A narrow strip and a fan: particles lie on them, and their number and energy are right."""
    rng = np.random.default_rng(number)
    turn = np.sort(rng.uniform(0, 2 * np.pi, 7))
    curve = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1) * rng.uniform(0.05, 1.0, (7, 1))
    fan = MeshSurface(scale * np.vstack([[0, 0, 0], curve]), [[0, 1 + i, 1 + (i + 1) % 7] for i in range(7)])
    strip = MeshSurface(
        scale * np.array([[3, 0, 0], [5, 0, 0], [5, 0.1, 0], [3, 0.1, 0]]), [[0, 1, 2], [0, 2, 3]]
    )
    relaxation = Relaxation([fan, strip], count=count, seed=number, iterations=30)
    energies, epochs = [], []
    for _ in range(30):
        relaxation.step()
        energies.append(relaxation.energy)
        epochs.append(relaxation.epoch)
    rises = np.diff(energies)[np.diff(epochs) == 0]
    assert (rises <= 0).all()
    assert relaxation.count == count
    for index, surface in enumerate((fan, strip)):
        own = relaxation.positions[relaxation.surface_ids == index]
        gaps = closest_points(own, surface.vertices, surface.faces)  # slim faces want more than float32
        assert gaps.max(initial=0.0) < 1e-4 * relaxation.spacing
