"""Derivatives of images, fields of all decals and their pushes, against float64 and closed forms."""

from typing import Any

import numpy as np
import pytest

from decals import Contact, Decals, Interaction, evaluate
from decals.errors import InvalidPoints
from decals.field.jacobian import folds_of, stretch_of
from decals.index import DecalEditor
from tests.decals.field.test_evaluate import dress, even_sphere, on_sphere
from tests.oracles.contact import RIM, complements, falloff, log_factor
from tests.oracles.decals import decals_at
from tests.vectors import unit

UP: list[float] = [0.0, 0.0, 1.0]


def plane(positions: Any, radii: Any, **columns: Any) -> Decals:
    count = len(positions)
    return Decals(positions, np.tile(UP, (count, 1)), [[1.0, 0.0, 0.0]] * count, radii, **columns)


@pytest.mark.parametrize("contact", Contact)
def test_jacobians_equal_differences_in_float64(contact: Contact) -> None:
    rng = np.random.default_rng(3)
    positions, normals = on_sphere(rng, 50)
    decals = dress(rng, positions, normals, np.full(50, 0.35))
    points = on_sphere(rng, 300)[0].astype(np.float32)
    wide = unit(points.astype(np.float64))
    turns = np.eye(3) - wide[:, :, None] * wide[:, None, :]
    found = evaluate(
        decals, points, points, contact=contact, jacobian=True, normal_derivatives=turns
    ).jacobian
    assert found is not None
    mode, step = contact.name.lower(), 1e-5
    center = decals_at(decals, points, wide, contact=mode)
    sure = (center.doubt > 2e-3) & (center.owner >= 0)  # no line of contact within a step of 1e-3
    assert sure.sum() > 200
    expected = np.empty((len(points), 2, 3))
    for axis in range(3):
        shift = step * (np.eye(3)[axis] - wide * wide[:, axis : axis + 1])
        ends = [
            decals_at(decals, points + sign * shift, unit(wide + sign * shift), contact=mode)
            for sign in (1, -1)
        ]
        expected[:, :, axis] = (ends[0].uv - ends[1].uv) / (2 * step)
    error = np.abs(found - expected)[sure].max(axis=(1, 2)) / np.abs(expected[sure]).max(axis=(1, 2))
    assert np.quantile(error, 0.9) <= 5e-3
    assert (error > 0.1).mean() <= 0.01  # RADIAL has kinks on rays to corners
    assert np.abs(np.einsum("mij,mj->mi", found, wide)[sure]).max() <= 1e-3 * np.abs(expected[sure]).max()


def test_jacobians_beside_lines_are_one_sided_and_nan_without_an_owner() -> None:
    pair = plane([[-0.6, 0, 0], [0.6, 0, 0]], [1.0, 1.0])
    found = evaluate(
        pair, [[-1e-4, 0, 0], [-1.2, 0, 0], [0.0, 3, 0]], [UP] * 3, contact="radial", jacobian=True
    )
    assert found.jacobian is not None
    np.testing.assert_allclose(found.jacobian[0], [[0.5 / 0.6, 0, 0], [0, 0.5 / 0.6, 0]], rtol=2e-3)
    np.testing.assert_allclose(found.jacobian[1], [[0.5, 0, 0], [0, 0.5, 0]], atol=2e-3)
    assert np.isnan(found.jacobian[2]).all()
    assert evaluate(pair, [[0, 0, 0]], [UP]).jacobian is None


def test_stretch_and_folds_are_those_of_the_singular_values() -> None:
    rng = np.random.default_rng(0)
    maps = rng.normal(size=(500, 2, 3)) * [1, 1, 0]
    sizes = np.linalg.svd(maps[:, :, :2], compute_uv=False)
    np.testing.assert_allclose(stretch_of(maps), sizes[:, 0] / sizes[:, 1], rtol=1e-6)
    assert np.array_equal(folds_of(maps, np.tile(UP, (500, 1))), np.linalg.det(maps[:, :, :2]) < 0)


def test_neighbors_are_all_decals_with_a_field() -> None:
    rng = np.random.default_rng(5)
    spill, layers = rng.random(400) < 0.1, rng.integers(0, 2, 400)
    base, points, _ = even_sphere(rng)
    decals, points = base.replace(spill=spill, layers=layers), points[:500].astype(np.float32)
    found = evaluate(decals, points, points, contact="product", neighbors=True)
    near = found.neighbors
    assert near is not None
    wide = points.astype(np.float64)
    squared = ((wide[:, None] - decals.positions.astype(np.float64)) ** 2).sum(axis=2)
    squared *= (RIM / decals.radii.astype(np.float64)) ** 2
    cosines = unit(wide) @ decals.normals.astype(np.float64).T
    fields = np.where(spill | (cosines > -0.25), falloff(np.sqrt(squared)), 0.0)
    dense = np.zeros_like(fields)
    rows = np.repeat(np.arange(len(points)), np.diff(near.offsets))
    dense[rows, near.decals] = near.fields
    np.testing.assert_allclose(dense, fields, atol=1e-6)
    assert (np.diff(near.decals)[np.diff(rows) == 0] > 0).all()
    owned = found.owner[rows] >= 0
    owner = np.where(owned, found.owner[rows], 0)
    e, least = complements(squared[rows, near.decals]), complements(squared[rows, owner])
    pushes = -np.expm1(log_factor(e, least))
    neighbor = owned & (near.decals != owner) & (layers[near.decals] == layers[owner]) & (e < least + 0.6)
    pushes[~neighbor | (e + least >= 1) | (squared[rows, near.decals] > 0.575**2)] = 0
    np.testing.assert_allclose(near.pushes, pushes, atol=2e-4)


@pytest.mark.parametrize("contact", Contact)
@pytest.mark.parametrize("radii", [(1.0, 1.0), (1.0, 0.7), (0.8, 1.1)])
def test_the_push_of_one_neighbor_gives_the_field(contact: Contact, radii: tuple[float, float]) -> None:
    pair = plane([[0, 0, 0], [1.1, 0, 0]], radii)
    points = np.random.default_rng(1).uniform(-1, 1.5, (300, 3)) * [1, 1, 0]
    found = evaluate(pair, points, np.tile(UP, (300, 1)), contact=contact, neighbors=True)
    near = found.neighbors
    assert near is not None
    rows = np.repeat(np.arange(300), np.diff(near.offsets))
    push = np.zeros(300)
    np.add.at(push, rows, near.pushes)
    owned = found.owner >= 0
    centers, sizes = pair.positions[found.owner[owned]], pair.radii[found.owner[owned]]
    t = np.linalg.norm(points[owned] - centers, axis=1) / sizes
    push = push[owned]
    assert (push > 0.01).sum() > 20
    if contact >= Contact.RADIAL:
        field = falloff(RIM * np.minimum(t + (1 - t) * push, 1))
    else:
        field = 1 - (complements((RIM * t) ** 2) * (1 - push) + 0.5 * push)
    np.testing.assert_allclose(found.field[owned], field, atol=1e-4)


def test_neighbors_of_an_editor_have_its_numbers() -> None:
    editor = DecalEditor(plane([[5, 0, 0], [0, 0, 0], [0.9, 0, 0]], 1.0))
    editor.delete(0)
    near = evaluate(editor, [[0.3, 0, 0], [9.0, 9, 9]], [UP] * 2, neighbors=True).neighbors
    assert near is not None
    assert near.offsets.tolist() == [0, 2, 2]
    assert near.decals.tolist() == [1, 2]
    assert (near.pushes[0], near.pushes[1] > 0) == (0, True)
    none = evaluate(Decals.empty(), [[0, 0, 0]], [UP], neighbors=True, jacobian=True)
    assert none.neighbors is not None
    assert none.neighbors.offsets.tolist() == [0, 0]


@pytest.mark.parametrize("wrong", [np.zeros((2, 3, 3)), np.zeros((1, 3)), "flat"])
def test_refuses_other_derivatives_of_normals(wrong: Any) -> None:
    with pytest.raises(InvalidPoints, match="normal_derivatives: expected"):
        evaluate(plane([[0, 0, 0]], 1.0), [[0, 0, 0]], [UP], jacobian=True, normal_derivatives=wrong)


def test_points_that_are_not_finite_have_no_derivative() -> None:
    disk = Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [1.0])
    points = [[0.2, 0, 0], [np.inf, 0, 0], [np.nan, 0, 0], [0, -np.inf, 0]]
    found = evaluate(disk, points, [[0, 0, 1]] * 4, jacobian=True).jacobian
    assert found is not None
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1:]).all()


@pytest.mark.ordinary_cases("corrected-elastic", "chord-product")
@pytest.mark.parametrize("contact", ["product", "min", "radial", "elastic"])
@pytest.mark.parametrize("mapping", ["chord", "corrected"])
def test_neighbors_tell_which_images_reach_a_point(contact: str, mapping: str) -> None:
    """Alone and after contact, a decal shows where an evaluation of it, or of its layer, says so."""
    rng = np.random.default_rng(5)
    count, size = 12, 1500
    layout = Decals(
        rng.uniform(-1, 1, (count, 3)) * [1, 1, 0],
        rng.normal(0, 0.2, (count, 3)) + UP,
        np.tile([1, 0, 0], (count, 1)),
        rng.uniform(0.2, 0.8, count),
        layers=rng.integers(0, 2, count),
        interactions=rng.integers(0, 3, count),
    )
    points, normals = rng.uniform(-1.5, 1.5, (size, 3)) * [1, 1, 0.1], np.tile(UP, (size, 1))
    modes: Any = {"contact": contact, "mapping": mapping}
    near = evaluate(layout, points, normals, **modes, neighbors=True).neighbors
    assert near is not None
    rows = np.repeat(np.arange(size), np.diff(near.offsets))

    def showing(numbers: Any) -> Any:
        found = evaluate(layout[numbers], points, normals, **modes)
        inside = ((found.uv.astype(float) - 0.5) ** 2).sum(axis=1) <= 0.25001
        return np.where((found.owner >= 0) & inside, np.asarray(numbers)[found.owner], -1)

    for number in range(count):
        alone, in_layer = (
            np.bincount(rows[(near.decals == number) & flags], minlength=size) == 1
            for flags in (near.alone, near.in_layer)
        )
        np.testing.assert_array_equal(alone, showing([number]) == number)
        pushes = layout.interactions[number] == Interaction.PUSH
        rank = np.flatnonzero(layout.ranks == layout.ranks[number]) if pushes else [number]
        np.testing.assert_array_equal(in_layer, showing(rank) == number)
