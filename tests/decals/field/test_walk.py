"""The walked mapping against exact unfoldings; decals that get relays; edits; wrong input."""

from typing import Any

import numpy as np
import pytest
import pyvista as pv

from blobtree import HalfSpace, Intersection, Point
from decals import Decals, ImageMapping, MeshObject, evaluate
from decals.errors import InvalidMesh, InvalidScene
from decals.field import Walks
from decals.field.walk import CELLS, GRID, NONE, NOWHERE, RELAY, RELAYS
from decals.index import DecalEditor
from decals.surfaces import ImplicitSurface, MeshSurface
from decals.surfaces.topology import edge_twins
from tests.decals.field import log_maps, unfolding
from tests.decals.field.unfolding import Patch, rms
from tests.vectors import unit


@pytest.mark.parametrize("degrees", [-90, 20, 60, 90, 120])
@pytest.mark.parametrize("distance", [0.1, 0.3, 0.8])
def test_images_run_on_over_edges(degrees: float, distance: float) -> None:
    patch = unfolding.edge(degrees, distance)
    walked, corrected = (
        rms(patch.errors(1.0, mode)) for mode in (ImageMapping.WALKED, ImageMapping.CORRECTED)
    )
    print(f"walked {walked:.5f}, corrected {corrected:.5f} of the radius")
    assert walked <= 0.003
    assert walked <= corrected


@pytest.mark.parametrize("place", [(0.5, 0.5), (0.7, 0.4), (0.9, 0.3), (0.9, 0.85), (0.95, 0.95)])
def test_images_run_on_round_the_corner_of_a_cube(place: tuple[float, float]) -> None:
    errors = unfolding.corner(*place).errors(1.0)
    print(f"{rms(errors):.5f}, largest {errors.max():.4f} of the radius")
    assert rms(errors) <= 0.003
    assert np.quantile(errors, 0.995) <= 0.01


CUBE = np.arccos(np.sqrt(1 / 3))
"""Angle between the edges of a cube and its diagonal."""


@pytest.mark.parametrize("distance", [0.0, 0.003, 0.05, 0.3])
@pytest.mark.parametrize(
    ("sides", "slope", "worst"),
    [(3, CUBE, 0.005), (4, 0.9, 0.007), (64, 0.54, 0.006), (64, 1.2, 0.025)],
)
def test_images_around_a_tip_break_at_the_cut_alone(
    sides: int, slope: float, worst: float, distance: float
) -> None:
    """The corner of a cube, a pyramid and two cones, seen from the tip itself and from beside it."""
    errors = unfolding.tip(sides, slope, distance).errors(1.0)
    print(f"{rms(errors):.5f}, largest {errors.max():.4f} of the radius")
    assert errors.max() <= worst


@pytest.mark.parametrize(("depth", "radius"), [(0.5, 0.8), (0.2, 0.5)])
def test_images_run_on_over_the_rim_of_a_cylinder(depth: float, radius: float) -> None:
    assert rms(unfolding.cylinder_rim(depth).errors(radius)) <= 0.005


@pytest.mark.parametrize(
    ("inside", "most"), [(0.0, 0.005), (0.01, 0.01), (0.02, 0.005), (0.04, 0.005), (0.1, 0.0018)]
)
def test_images_centred_near_the_rim_of_a_cylinder(inside: float, most: float) -> None:
    """Walks past a focus, which are not the shortest, leave no relays; relays that see badly count little."""
    errors = unfolding.cylinder_end(inside).errors(0.8)
    print(f"{rms(errors):.5f}, largest {errors.max():.4f} of the radius")
    assert rms(errors) <= most


@pytest.mark.parametrize("seed", [0, 3])
def test_large_images_on_bumps(seed: int) -> None:
    patch = unfolding.bumpy(seed, 0.5)
    assert rms(patch.errors(0.5)) <= 0.0015 < rms(patch.errors(0.5, ImageMapping.CORRECTED))


@pytest.mark.parametrize(("size", "shift"), [(1e-3, 0.0), (1e4, 0.0), (1.0, 300.0)])
def test_walks_do_not_depend_on_size_and_place(size: float, shift: float) -> None:
    patch = unfolding.edge(90, 0.3, 400, size=size, shift=np.full(3, shift))
    assert rms(patch.errors(size)) <= 1e-3


def test_a_decal_centred_on_an_edge() -> None:
    """Its normal is the mean of those of both faces."""
    half = np.sqrt(0.5)
    straight = unfolding.edge(90, 0.0)
    patch = Patch(
        **{
            **vars(straight),
            "normal": np.array([half, 0, half]),
            "tangent": np.array([half, 0, -half]),
        }
    )
    assert rms(patch.errors(1.0)) <= 0.0025


def ball() -> MeshSurface:
    sphere = pv.Icosphere(nsub=5)
    return MeshSurface(np.asarray(sphere.points), sphere.regular_faces)


def test_decals_that_the_corrected_mapping_draws_correctly_get_no_relays() -> None:
    rng = np.random.default_rng(0)
    centres = unit(rng.normal(size=(50, 3)))
    decals = Decals(centres, centres, log_maps.tangents(rng, centres), np.full(50, 0.2))
    walks = Walks.over(decals, [ball()])
    assert len(walks.texels) == len(walks) == 50
    points = unit(rng.normal(size=(500, 3)))
    walked = evaluate(decals, points, points, mapping="walked", walks=walks, device="cpu")
    assert walked.uv == pytest.approx(evaluate(decals, points, points, device="cpu").uv, abs=1e-6)


def test_one_model_stands_for_a_sequence_of_one() -> None:
    cube = pv.Cube()
    decals = Decals([[0.4, 0, 0.5]], [[0, 0, 1]], [[1, 0, 0]], [0.3])
    several = Walks.over(decals, [cube]).texels
    assert len(several) == 1 + GRID
    mesh = cube.triangulate()
    pair = np.asarray(mesh.points), mesh.regular_faces
    for one in (cube, MeshSurface(*pair), MeshObject("cube", *pair), pair, iter([cube])):
        np.testing.assert_array_equal(Walks.over(decals, one).texels, several)
    wrong: Any
    for wrong in (5, None, [5], MeshSurface):
        with pytest.raises(InvalidMesh, match="surface: expected a model, got"):
            Walks.over(decals, wrong)


def test_walks_fade_into_the_corrected_mapping_where_they_do_not_lead() -> None:
    """The second box is not joined to the first; its upper face lies in the same plane."""
    boxes = [pv.Cube(center=(x, 0, 0)).triangulate() for x in (0.0, 1.0)]
    surfaces = [MeshSurface(np.asarray(box.points), box.regular_faces) for box in boxes]
    decals = Decals([[0.3, 0, 0.5]], [[0, 0, 1]], [[1, 0, 0]], [0.6])
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-0.1, 0.8, 60), np.linspace(-0.4, 0.4, 30)))
    points = np.column_stack([x, y, 0 * x + 0.5])
    walks = Walks.over(decals, surfaces)
    assert len(walks.texels) == 1 + GRID
    seen = evaluate(decals, points, 0 * points + [0, 0, 1], mapping="walked", walks=walks, device="cpu")
    drawn = 1.2 * (seen.uv - 0.5)
    inside = np.hypot(x - 0.3, y) < 0.59
    assert drawn[inside] == pytest.approx(points[inside, :2] - [0.3, 0], abs=1e-4)


def test_walks_over_a_tree() -> None:
    """A ball with a flat side: along a meridian to the edge, and straight down from there."""
    tree = Intersection(Point((0, 0, 0), radius=1.0), HalfSpace((0.6, 0, 0), (1, 0, 0), 2.0, radius=0.5))
    surface, start, edge = ImplicitSurface(tree), 1.3, np.arccos(0.6)
    t = np.linspace(0.02, 0.55, 20)
    turn, down = np.maximum(start - t, edge), np.maximum(t - (start - edge), 0.0)
    points = np.stack([np.cos(turn), 0 * t, np.sin(turn) - down], axis=1)
    normals = np.where(down[:, None] > 0, [1.0, 0, 0], points)
    centre = [[np.cos(start), 0, np.sin(start)]]
    decals = Decals(centre, centre, [[0, 1, 0]], [0.6])
    walks = Walks.over(decals, [surface])
    seen = evaluate(decals, points, normals, mapping="walked", walks=walks, device="cpu")
    assert (seen.owner == 0).all()
    assert seen.uv[:, 0] == pytest.approx(0.5, abs=0.003)
    assert 1.2 * (0.5 - seen.uv[:, 1]) == pytest.approx(t, abs=0.004)


def test_an_edit_walks_again_for_changed_decals_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    cube = pv.Cube().triangulate().clean()
    surface = MeshSurface(np.asarray(cube.points), cube.regular_faces)
    x = np.array([-0.4, 0.0, 0.4, 0.45])
    decals = Decals(
        np.column_stack([x, 0 * x, 0 * x + 0.5]), [[0, 0, 1]] * 4, [[1, 0, 0]] * 4, [0.3, 0.2, 0.3, 0.2]
    )
    editor = DecalEditor(decals)
    first = Walks.over(editor, [surface])
    moved = decals[[1]].replace(positions=[[0.0, 0.4, 0.5]])
    editor.assign([1], moved)
    editor.delete([3])
    walked: list[int] = []
    launch = Walks.over.__func__.__globals__["_walk"]  # type: ignore[attr-defined]

    def counted(rows: Any, meshes: Any) -> Any:
        walked.append(len(rows))
        return launch(rows, meshes)

    monkeypatch.setattr("decals.field.walks._walk", counted)
    after, anew = Walks.over(editor, [surface], previous=first), Walks.over(editor, [surface])
    assert walked[0] < walked[1]
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (200, 3)) * [1, 1, 0] + [0, 0, 0.5]
    uv = [
        evaluate(editor, points, 0 * points + [0, 0, 1], mapping="walked", walks=walks, device="cpu").uv
        for walks in (after, anew)
    ]
    assert np.array_equal(uv[0], uv[1])


@pytest.mark.parametrize("walks", [None, "surface", Walks.over(Decals.empty(), [])])
def test_walks_of_other_decals_are_refused(walks: Any) -> None:
    one = Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [1])
    with pytest.raises(InvalidScene, match=r"walks: expected walks of these 1 decals.*Walks\.over"):
        evaluate(one, [[0, 0, 0]], [[0, 0, 1]], mapping="walked", walks=walks, device="cpu")


def test_walks_on_hostile_meshes() -> None:
    """Open, non-manifold and degenerate triangles; a decal far away, one that faces away, one at a vertex."""
    rng = np.random.default_rng(0)
    soup = rng.uniform(-1, 1, (60, 3))
    soup[10:13] = soup[7:10]
    faces = np.vstack([np.arange(60).reshape(-1, 3), rng.integers(0, 60, (20, 3)), [[0, 0, 1]]])
    surface = MeshSurface(soup, faces)
    normal = surface.normal(soup[:3])
    decals = Decals(
        np.vstack([soup[:3], [[9, 9, 9.0]], soup[:1]]),
        np.vstack([normal, normal[:1], -normal[:1]]),
        np.vstack(
            [
                log_maps.tangents(rng, normal),
                log_maps.tangents(rng, normal[:1]),
                log_maps.tangents(rng, normal[:1]),
            ]
        ),
        [0.5, 1.0, 2.0, 1.0, 1.0],
    )
    walks = Walks.over(decals, [surface])
    assert np.isfinite(walks.texels).all()
    grids = walks.texels[len(walks) :].reshape(-1, GRID, 4)
    there = grids[:, :RELAYS:RELAY, 0] != NOWHERE
    numbers = grids[:, RELAYS : RELAYS + CELLS].astype(np.int64)
    assert (numbers & NONE != NONE).any()
    for listed in (numbers & NONE, numbers >> 9 & NONE):  # cells list relays that are there
        grid, _cell, _part = np.nonzero(listed != NONE)
        assert there[grid, listed[listed != NONE]].all()
    points, normals = surface.project(rng.uniform(-1, 1, (2000, 3)))
    seen = evaluate(decals, points, normals, mapping="walked", walks=walks, device="cpu")
    assert np.isfinite(seen.uv).all()


def test_twins_of_edges() -> None:
    """Of three triangles around an edge none has a twin there."""
    corners = np.array([[0, 1, 2], [2, 1, 3], [1, 2, 4], [3, 4, 2]])
    twins = edge_twins(corners).reshape(-1, 3)
    assert twins[1].tolist() == [-1, -1, 11]
    assert twins[3].tolist() == [-1, 7, 5]
