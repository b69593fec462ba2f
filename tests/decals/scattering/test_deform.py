"""Particles and decals that are carried along while surfaces deform."""

from typing import Any

import numpy as np
import pytest

from blobtree import Point, Segment
from decals import Relaxation
from decals.errors import InvalidScattering
from decals.surfaces import ImplicitSurface, MeshSurface
from tests.decals.meshes import box, plane, sphere
from tests.oracles.sized_decals import covered, nearest_facing


def stretched(ball: MeshSurface, factors: tuple[float, float, float]) -> MeshSurface:
    return MeshSurface(ball.vertices * np.array(factors, np.float32), ball.faces)


def test_particles_stay_at_their_point_of_a_face() -> None:
    ball = sphere()
    relaxation = Relaxation([ball], count=300)
    relaxation.run()
    before = relaxation.positions
    relaxation.deform([stretched(ball, (2.0, 1.0, 0.5))])
    assert relaxation.positions == pytest.approx(before * [2.0, 1.0, 0.5], abs=1e-5)
    assert relaxation.count == 300


def test_particles_follow_a_mesh_that_turns() -> None:
    """Half a turn: the closest place of the new mesh would be quite another one."""
    slab = box((2.0, 1.0, 0.3))
    relaxation = Relaxation([slab], count=200, iterations=40)
    relaxation.run()
    before = relaxation.positions
    relaxation.deform([stretched(slab, (-1.0, -1.0, 1.0))])
    assert relaxation.positions == pytest.approx(before * [-1.0, -1.0, 1.0], abs=1e-5)


def test_steps_after_stretching_restore_evenness() -> None:
    ball = sphere()
    relaxation = Relaxation([ball], count=600)
    relaxation.run()
    for frame in range(1, 9):
        relaxation.deform([stretched(ball, (1.0 + 0.15 * frame, 1.0, 1.0))])
        for _ in range(4):
            relaxation.step()
        assert relaxation.statistics().rho > 0.6
    for _ in range(40):
        relaxation.step()
    assert relaxation.statistics().rho > 0.75
    relaxation.polish()
    statistics = relaxation.statistics()
    assert relaxation.spacing == pytest.approx(statistics.ideal)
    assert statistics.rho > 0.85
    assert statistics.cv < 0.03


def blob(shift: float) -> ImplicitSurface:
    return ImplicitSurface(
        Point((shift, 0, 0), radius=1.0) + Segment((shift, 0, 0), (shift + 1.5, 0.5, 0), radius=0.4)
    )


def test_particles_follow_the_field_of_a_tree() -> None:
    relaxation = Relaxation([blob(0.0)], count=400)
    relaxation.run()
    for frame in range(1, 6):
        moved = blob(0.1 * frame)
        relaxation.deform([moved])
        relaxation.step()
        positions = relaxation.positions
        assert (
            np.linalg.norm(moved.project(positions)[0] - positions, axis=1).max() < 1e-4 * relaxation.spacing
        )
    for _ in range(30):
        relaxation.step()
    assert relaxation.statistics().rho > 0.75
    assert positions[:, 0].max() > 1.5


def test_hidden_particles_are_resampled_and_fixed_ones_stay() -> None:
    slab = plane(4.0)
    relaxation = Relaxation([slab, sphere(center=(0, 0, 3.0))], count=400, fixed=[(0.0, 0.0, 0.0)])
    relaxation.run()
    counts = np.bincount(relaxation.surface_ids)
    ball = sphere(center=(0, 0, 0.2))
    relaxation.deform([slab, ball])
    own = (relaxation.surface_ids == 0) & ~relaxation.fixed
    assert not ball.contains(relaxation.positions[own]).any()
    assert np.array_equal(np.bincount(relaxation.surface_ids), counts)
    assert np.abs(relaxation.positions[relaxation.fixed]).max() < 1e-6
    for _ in range(60):
        relaxation.step()
    assert not ball.contains(relaxation.positions[own]).any()
    nearest = nearest_facing(relaxation.positions[own], relaxation.normals[own])
    assert nearest.min() > 0.5 * np.median(nearest)


def test_deformation_is_deterministic() -> None:
    def run() -> bytes:
        relaxation = Relaxation([blob(0.0), sphere(center=(0, 2.5, 0))], count=150, iterations=20)
        relaxation.run()
        relaxation.deform([blob(0.2), sphere(center=(0, 1.5, 0))])
        relaxation.step()
        return relaxation.positions.tobytes()

    assert run() == run()


def test_decals_on_a_deformed_surface_leave_no_gaps() -> None:
    ball = sphere(level=4)
    relaxation = Relaxation([ball], count=150)
    relaxation.run()
    longer = stretched(ball, (1.5, 1.0, 1.0))
    relaxation.deform([longer])
    for _ in range(10):
        relaxation.step()
    decals = relaxation.to_decals(seed=1)
    assert covered(decals, *longer.sample(4000, seed=3)).all()


def test_invalid_deformations_raise() -> None:
    relaxation = Relaxation([sphere(center=(5, 0, 0), level=2), plane()], count=50, iterations=2)
    with pytest.raises(InvalidScattering, match="2 surfaces as before, got 1"):
        relaxation.deform([sphere()])
    with pytest.raises(InvalidScattering, match="visible area"):
        relaxation.deform([sphere(level=2), plane(0.1)])
    empty = Relaxation([plane()], count=0)
    empty.deform([plane(2.0)])
    assert empty.count == 0


def test_particles_follow_a_tree_that_jumps() -> None:
    """The nearest place of a ball ten radii off is a small cap of it."""
    relaxation = Relaxation([blob(0.0)], count=400)
    relaxation.run()
    before = relaxation.positions
    relaxation.deform([blob(20.0)])
    assert relaxation.positions == pytest.approx(before + np.array([20, 0, 0], np.float32), abs=2e-3)
    assert relaxation.statistics().rho > 0.8


@pytest.mark.parametrize("factors", [(3.0, 3.0, 3.0), (4.0, 1.0, 1.0)])
def test_particles_follow_a_distant_mesh_of_other_faces(factors: tuple[float, float, float]) -> None:
    relaxation = Relaxation(sphere(), count=300)
    relaxation.run()
    other = sphere(level=5)
    far = MeshSurface(
        other.vertices * np.array(factors, np.float32) + np.array([0, 50, 0], np.float32), other.faces
    )
    relaxation.deform(far)
    gaps = np.linalg.norm(far.project(relaxation.positions)[0] - relaxation.positions, axis=1)
    assert gaps.max() < 1e-4 * relaxation.spacing
    for _ in range(40):
        relaxation.step()
    assert relaxation.statistics().rho > 0.6


def test_collapsing_deformation_raises_and_changes_nothing() -> None:
    """A ball becomes two scraps at the far corners of a large box."""
    relaxation = Relaxation([sphere()], count=300, iterations=40)
    relaxation.run()
    positions, spacing, domain = relaxation.positions.copy(), relaxation.spacing, relaxation.domain
    corner = 0.02 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    scraps = np.concatenate([np.add(corner, 30.0), np.add(corner, 60.0)])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    with pytest.raises(InvalidScattering, match="surface 0: expected one that its 300 particles can follow"):
        relaxation.deform([MeshSurface(scraps, np.concatenate([faces, faces + 4]))])
    assert np.array_equal(relaxation.positions, positions)
    assert relaxation.spacing == spacing
    assert relaxation.domain is domain
    relaxation.step()
    assert relaxation.statistics().rho > 0.5


@pytest.mark.parametrize("wrong", [None, 5, [None], "x", [sphere(), None], []])
def test_deformation_to_invalid_surfaces_raises(wrong: Any) -> None:
    relaxation = Relaxation([sphere()], count=20, iterations=2)
    with pytest.raises(InvalidScattering, match="expected"):
        relaxation.deform(wrong)
    assert relaxation.count == 20
