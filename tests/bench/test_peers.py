"""The other methods of `python -m tests.bench.decals --peers` are implemented correctly."""

from typing import Any

import numpy as np
import pytest

from decals import Decals
from tests.bench import decal_peers, peer_errors, peer_pictures, projected_boxes
from tests.bench.cellular_textures import RINGS, SECTORS, Cells, cover, domes, simulate
from tests.bench.clipped_decals import MeshDecals
from tests.bench.exponential_maps import ExponentialMaps
from tests.bench.implicit_uvs import STEPS, nearest
from tests.bench.implicit_uvs import log_maps as walk_maps
from tests.bench.texture_sprites import Sprites, shown_by_all
from tests.bench.tile_trees import TileTree
from tests.decals.field import log_maps
from tests.decals.shapes import sheet_faces, torus
from tests.vectors import unit

TORUS = peer_errors.torus_mesh(rows=120)
"""A torus mesh of 14,400 faces."""


def areas(vertices: Any, faces: Any) -> Any:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def on_plane(count: int, seed: int) -> tuple[MeshDecals, Decals]:
    """Return a plane of 800 triangles, and decals inside it."""
    n = 21
    x, y = np.meshgrid(np.linspace(-2, 2, n), np.linspace(-2, 2, n), indexing="ij")
    vertices = np.stack([x, y, 0.2 * x], -1).reshape(-1, 3).astype(np.float32)
    faces = sheet_faces(n, n).astype(np.int32)
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (count, 2))
    positions = np.column_stack([points, 0.2 * points[:, 0]])
    normals = np.tile([-0.2, 0, 1.0], (count, 1))
    decals = Decals(positions, normals, rng.normal(size=(count, 3)), rng.uniform(0.05, 0.6, count))
    return MeshDecals(vertices, faces), decals


def test_each_box_cuts_a_square_out_of_a_plane() -> None:
    mesh, decals = on_plane(50, 1)
    result = mesh.clip(decals)
    area = np.bincount(result.decals, areas(result.vertices, result.faces), minlength=50)
    np.testing.assert_allclose(area, (2 * decals.radii.astype(float)) ** 2, rtol=1e-5)
    assert result.uv.min() >= -1e-9
    assert result.uv.max() <= 1 + 1e-9
    for decal in range(50):
        corners = result.faces[result.decals == decal].reshape(-1)
        frame = np.stack([decals.tangents[decal], decals.bitangents[decal]], 1).astype(float)
        away = result.vertices[corners] - decals.positions[decal]
        uv = 0.5 + 0.5 * away @ frame / decals.radii[decal]
        np.testing.assert_allclose(result.uv[corners], uv, atol=1e-6)


def test_clipping_keeps_exactly_the_area_in_the_box() -> None:
    """Area in each box against points spread over the mesh."""
    shape = torus(rows=60, columns=30)
    rng = np.random.default_rng(2)
    corners = shape.vertices.astype(float)[shape.faces]
    sizes = areas(shape.vertices.astype(float), shape.faces)
    face = rng.choice(len(sizes), 400_000, p=sizes / sizes.sum())
    points = np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], len(face)), corners[face])
    decals = Decals(points[:6], rng.normal(size=(6, 3)), rng.normal(size=(6, 3)), np.full(6, 0.35))
    result = MeshDecals(shape.vertices, shape.faces).clip(decals)
    area = np.bincount(result.decals, areas(result.vertices, result.faces), minlength=6)
    for decal in range(6):
        frame = np.stack([decals.tangents[decal], decals.bitangents[decal], decals.normals[decal]], 1)
        inside = (np.abs((points - decals.positions[decal]) @ frame) <= decals.radii[decal]).all(axis=1)
        assert area[decal] == pytest.approx(inside.mean() * sizes.sum(), rel=0.03)


def test_a_decal_away_from_the_mesh_is_empty() -> None:
    mesh, decals = on_plane(1, 3)
    result = mesh.clip(decals.replace(positions=[[0, 0, 30]]))
    assert len(result.faces) == 0


def test_values_are_interpolated_linearly() -> None:
    rng = np.random.default_rng(4)
    face = rng.integers(0, len(TORUS.faces), 500)
    points = np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], 500), TORUS.vertices[TORUS.faces[face]])
    locator = peer_errors.Locator(TORUS.vertices, TORUS.faces)
    np.testing.assert_allclose(locator.interpolate(TORUS.vertices, points), points, atol=1e-12)


def test_discs_are_geodesic() -> None:
    """On a torus the outer equator is one: along it the log map is the angle times the radius 1.4."""
    mesh = peer_errors.torus_mesh(rows=40)
    points, logs = mesh.discs(np.random.default_rng(5), np.array([0]), 0.3, 50)
    assert np.linalg.norm(logs[0], axis=1).max() <= 0.3
    assert np.abs(np.hypot(np.hypot(*points[0, :, :2].T) - 1, points[0, :, 2]) - 0.4).max() < 1e-6
    assert (np.linalg.norm(logs[0], axis=1) >= np.linalg.norm(points[0] - mesh.vertices[0], axis=1)).all()


def test_errors_of_the_methods() -> None:
    """Of decals a fifth of the tube: projection is the worst, vertices lose little on a fine mesh."""
    mesh, rng = TORUS, np.random.default_rng(6)
    vertex = 1234
    points, logs = mesh.discs(rng, np.array([vertex]), 0.1, 400)
    expected = logs[0] @ peer_errors.frame_at(mesh, vertex)[:2].T

    def error(offsets: Any) -> float:
        computed = offsets(mesh, vertex, points[0], 0.1)
        return float(np.sqrt(((computed - expected) ** 2).sum(axis=1).mean()) / 0.1)

    assert error(peer_errors.implicit) < 0.002 < error(peer_errors.planar) < 0.01
    assert error(peer_errors.at_vertices) == pytest.approx(error(peer_errors.implicit), abs=1e-3)
    maps = peer_errors.potpourri()
    if maps is not None:
        assert error(maps.offsets) < 0.003


def test_table_and_figures_are_equal() -> None:
    row = decal_peers.Row("log maps (x 1)", "no contact", setup_s=2.0, decal_ms=50.0, megabytes=3.0)
    row.errors = {"torus_large": 0.01}
    text = decal_peers.table("a knot", [row, row])
    assert "| log maps (x 1) | 2 | 50 | 52 | 3 |  | 1.00% |" in text
    assert decal_peers.figures([row]) == {
        "log_maps_torus_large": 0.01,
        "log_maps_setup_s": 2.0,
        "log_maps_decal_ms": 50.0,
        "log_maps_megabytes": 3.0,
    }


def rolled_sheet(radius: float, *, side: int = 41) -> tuple[Any, Any, Any, Any]:
    """Return vertices, faces, normals and flat coordinates of a sheet with random points, rolled up."""
    rng = np.random.default_rng(5)
    i, j = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    flat = np.stack([i, j], -1).reshape(-1, 2) / (side - 1) - 0.5
    flat += rng.uniform(-0.2, 0.2, flat.shape) / side
    angle = flat[:, 0] / radius
    normals = np.column_stack([np.sin(angle), np.zeros(len(flat)), np.cos(angle)])
    vertices = np.column_stack([radius * normals[:, 0], flat[:, 1], radius * (normals[:, 2] - 1)])
    return vertices, sheet_faces(side, side), normals, flat


@pytest.mark.parametrize(("radius", "limit"), [(1e6, 1e-6), (0.2, 2e-3)])
def test_exponential_maps_unroll_what_can_be_unrolled(radius: float, limit: float) -> None:
    vertices, faces, normals, flat = rolled_sheet(radius)
    center = len(vertices) // 2
    reached, offsets = ExponentialMaps.of(vertices, faces, normals).map(center, 0.4)
    along = np.cross([0.0, 1.0, 0.0], normals[center])
    coordinates = offsets @ np.stack([along, [0.0, 1.0, 0.0]], axis=1)
    assert len(reached) > 300
    assert np.linalg.norm(coordinates - (flat[reached] - flat[center]), axis=1).max() < limit


def sheets(*offsets: tuple[float, float, bool]) -> tuple[Any, Any]:
    """Return level squares of side 4 with 3,200 triangles each: their x, height, and whether they face up."""
    n = 41
    x, y = np.meshgrid(np.linspace(-2, 2, n), np.linspace(-2, 2, n), indexing="ij")
    faces = sheet_faces(n, n)
    vertices = [np.stack([x + shift, y, 0 * x + height], -1).reshape(-1, 3) for shift, height, _ in offsets]
    parts = [(faces if up else faces[:, ::-1]) + number * n * n for number, (_, _, up) in enumerate(offsets)]
    return np.concatenate(vertices).astype(np.float32), np.concatenate(parts).astype(np.int32)


def test_boxes_mark_sheets_below_and_behind() -> None:
    """Three sheets in the box, one of which faces away; a fourth lies below the box, the fifth beside it."""
    vertices, faces = sheets((0, 0, True), (0, -0.5, False), (0, -0.9, True), (0, -1.2, True), (9, 0, True))
    decals = Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [1.0])
    found = projected_boxes.marks(MeshDecals(vertices, faces), faces, decals)
    assert found.backward == pytest.approx(1 / 3)
    assert found.other == pytest.approx(2 / 3)
    assert found.other_faded == pytest.approx(1 / 2)
    assert found.own_lost == pytest.approx(0)
    np.testing.assert_allclose(
        projected_boxes.opacity(np.cos(np.radians([0, 60, 75, 100]))), [1, 1, 0.5176, 0], atol=1e-4
    )


def test_boxes_are_drawn_behind_the_surface() -> None:
    """The eye is far above: the first box contains the point, the second lies in front, others behind it."""
    decals = Decals(
        [[0, 0, 0], [0, 0, 3], [0, 0, -3], [5, 0, 0]], [[0, 0, 1]] * 4, [[1, 0, 0]] * 4, [1.0] * 4
    )
    drawn, used = projected_boxes.fragments(decals, np.array([0, 0, 100.0]), np.array([[0.1, 0.2, 0]]))
    assert (drawn, used) == (2, 1)


def sprites_on_a_torus(count: int, radius: float) -> tuple[Decals, Any, Any]:
    """Return decals and points on the torus of the tests, with the normals of the points."""
    rng = np.random.default_rng(8)
    points = log_maps.torus_points(rng, count + 3_000)
    normals = unit(log_maps.torus_gradient(points))
    radii = rng.uniform(0.5, 1, count) * radius
    decals = Decals(points[:count], normals[:count], rng.normal(size=(count, 3)), radii)
    return decals, points[count:], normals[count:]


@pytest.mark.parametrize(("radius", "full"), [(0.12, False), (0.6, True)])
def test_sprites_show_the_last_of_all(radius: float, full: bool) -> None:
    """Where leaves are full they keep those on top, and a few points may be wrong."""
    count = 150
    decals, points, normals = sprites_on_a_torus(count, radius)
    frames = np.stack([decals.tangents, decals.bitangents, decals.normals], 1).astype(float)
    local = np.einsum("nki,mni->mnk", frames, points[:, None] - decals.positions) / decals.radii[:, None]
    inside = (np.abs(local) <= 1).all(axis=2) & (normals @ decals.normals.T > 0)
    expected = np.where(inside, np.arange(count), -1).max(axis=1)
    owner, number = shown_by_all(decals, points, normals)
    np.testing.assert_array_equal(owner, expected)
    np.testing.assert_array_equal(number, inside.sum(axis=1))
    sprites = Sprites.of(decals)
    drawn, _ = sprites.shown(points, normals)
    assert (sprites.tree.dropped > 0) == full
    assert (drawn != expected).mean() <= (0.01 if full else 0)
    assert inside[np.flatnonzero(drawn >= 0), drawn[drawn >= 0]].all()


def test_a_full_leaf_loses_a_sprite_below() -> None:
    """Eight boxes end just beside the point, in its leaf; the ninth, which contains it, is dropped."""
    x = np.array([0.0] + [1.02] * 8)
    decals = Decals(np.column_stack([x, 0 * x, 0 * x]), [[0, 0, 1]] * 9, [[1, 0, 0]] * 9, [1.0] * 9)
    point, up = np.array([[0.015, 0.1, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    assert shown_by_all(decals, point, up)[0].tolist() == [0]
    assert Sprites.of(decals).shown(point, up)[0].tolist() == [-1]
    assert Sprites.of(decals[:8]).shown(point, up)[0].tolist() == [0]


def test_a_ball_needs_six_tiles() -> None:
    rng = np.random.default_rng(3)
    normals = unit(rng.normal(size=(20_000, 3)))
    tree = TileTree.of(2 * normals, normals)
    assert (tree.voxels, len(tree.width), tree.reads) == (1, 6, 1)
    assert tree.cosine.min() == pytest.approx(3**-0.5, abs=0.02)
    assert tree.texels(25.0) == pytest.approx(6 * 101**2, rel=0.02)


def test_tiles_show_one_sheet_each() -> None:
    """Samples of a torus in the same texel are neighbours, and two level sheets are told apart."""
    points = log_maps.torus_points(np.random.default_rng(4), 30_000)
    tree = TileTree.of(points, unit(log_maps.torus_gradient(points)))
    texel = (tree.place * tree.width[tree.tile, None] / 0.05).astype(int)
    order = np.lexsort([texel[:, 1], texel[:, 0], tree.tile])
    same = (np.diff(np.column_stack([tree.tile, texel])[order], axis=0) == 0).all(axis=1)
    gaps = np.linalg.norm(np.diff(points[order], axis=0), axis=1)[same]
    assert same.sum() > 12_000
    assert gaps.max() < 0.05 * 6**0.5
    x, y = np.random.default_rng(5).uniform(0, 1, (2, 20_000))
    level = np.column_stack([x, y, np.where(np.arange(len(x)) % 2, 0.2, 0.8)])
    pair = TileTree.of(level, np.tile([0, 0, 1.0], (len(x), 1)))
    assert (pair.voxels, len(pair.width)) == (9, 8)
    deeper = TileTree.of(level, np.tile([0, 0, 1.0], (len(x), 1)), least=2)
    assert (deeper.voxels, len(deeper.width)) == (1 + 8 + 8 * 8, 32)


def ball(points: Any) -> Any:
    """Return signed distances of points from the unit sphere, and normals."""
    distance = np.linalg.norm(points, axis=1)
    return distance - 1, points / distance[:, None]


CELL = 0.5
"""Size of cells on the unit sphere."""


def grown() -> Any:
    """Return cells on the unit sphere, grown from three near it; a fourth is far away and dies."""
    start = np.array([[0, 0, 1.2], [0.1, 0, 1.2], [0, 0.9, 0], [0, 0, 4.0]])
    return simulate(Cells.at(start, ball, CELL), ball, CELL)


def test_cells_divide_until_they_cover_a_ball() -> None:
    """They are upright and of full size, leave no room for another, and touch six others at most."""
    rest = grown()
    cells = rest.cells
    assert rest.deaths > 0
    assert len(cells) == 4 + rest.divisions - rest.deaths
    np.testing.assert_allclose(np.linalg.norm(cells.positions, axis=1), 1, atol=0.01 * CELL)
    np.testing.assert_allclose(cells.sizes, CELL, rtol=1e-3)
    np.testing.assert_allclose((cells.normals * cells.positions).sum(axis=1), 1, atol=1e-3)
    np.testing.assert_allclose((cells.normals * cells.tangents).sum(axis=1), 0, atol=1e-9)
    gaps = np.linalg.norm(cells.positions[:, None] - cells.positions, axis=2) + 9 * np.eye(len(cells))
    assert gaps.min() > 1.2 * CELL
    away = unit(np.random.default_rng(0).normal(size=(5_000, 3)))
    holes = np.linalg.norm(away[:, None] - cells.positions, axis=2).min(axis=1)
    assert holes.max() < 2 * CELL
    assert 0.7 < len(cells) * CELL**2 / 4 < 1.1


def test_cells_repel_align_and_rest() -> None:
    """Two cells on a plane part until they touch, along their line, and turn to each other's tangent."""

    def plane(points: Any) -> Any:
        return points[:, 2], np.tile([0.0, 0.0, 1.0], (len(points), 1))

    turn = np.array([0.0, 1.0])
    cells = Cells(
        np.array([[-0.5, 0, 0], [0.5, 0, 0.1]]),
        np.tile([0.0, 0.0, 1.0], (2, 1)),
        np.column_stack([np.cos(turn), np.sin(turn), [0, 0]]),
        np.ones(2),
    )
    # With much unrest allowed, the cells do not live to divide.
    rest = simulate(cells, plane, 1.0, unrest=1.0)
    assert (rest.steps, rest.divisions) == (1, 0)
    for _ in range(60):
        rest = simulate(rest.cells, plane, 1.0, unrest=1.0)
    assert rest.cells.positions[:, 0] == pytest.approx([-1, 1], abs=1e-3)
    np.testing.assert_allclose(rest.cells.positions[:, 1:], 0, atol=1e-3)
    angle = np.arctan2(rest.cells.tangents[:, 1], rest.cells.tangents[:, 0])
    np.testing.assert_allclose(angle, 0.5, atol=0.05)


def test_domes_and_the_area_under_discs() -> None:
    """Areas seen from above are those of polygons; three discs in a row overlap in two lenses."""
    places = np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    up, along = np.tile([0.0, 0.0, 1.0], (3, 1)), np.tile([1.0, 0.0, 0.0], (3, 1))
    cells = Cells(places, up, along, np.full(3, 0.6))
    mesh = domes(cells)
    assert len(mesh.faces) == 3 * SECTORS * (2 * RINGS - 1)
    flat = mesh.vertices * [1, 1, 0]
    corners = flat[mesh.faces]
    signed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    assert signed.min() > 0
    polygon = 0.5 * SECTORS * np.sin(2 * np.pi / SECTORS) * 0.6**2
    np.testing.assert_allclose(np.bincount(mesh.decals, signed), polygon)
    assert mesh.vertices[:, 2].max() == pytest.approx(0.3 * 0.6)
    offsets = (flat - np.repeat(places, len(flat) // 3, axis=0))[:, :2]
    np.testing.assert_allclose(mesh.uv, 0.5 + offsets / 1.2, atol=1e-12)
    points = np.column_stack([np.random.default_rng(1).uniform(-2, 2, (40_000, 2)), np.zeros(40_000)])
    count = cover(cells, points, np.tile([0.0, 0.0, 1.0], (40_000, 1)))
    half = np.arccos(0.5 / 0.6)
    lens = 2 * 0.6**2 * (half - np.sin(half) * np.cos(half))
    assert 16 * (count > 1).mean() == pytest.approx(2 * lens, rel=0.1)
    assert 16 * (count > 0).mean() == pytest.approx(3 * np.pi * 0.6**2 - 2 * lens, rel=0.03)


def test_rims_of_flat_discs_leave_a_torus() -> None:
    """By half the radius times the curvature along it, for small ones."""
    tube, way = np.meshgrid(*2 * [np.linspace(0, 2 * np.pi, 400, endpoint=False)])
    curvature = np.cos(way) ** 2 / 0.4 + np.sin(way) ** 2 * np.cos(tube) / (1 + 0.4 * np.cos(tube))
    assert decal_peers.rim_gap(0.02) == pytest.approx(0.01 * np.abs(curvature).mean(), rel=0.05)


def test_walks_to_a_seed_unroll_planes_and_spheres() -> None:
    rng = np.random.default_rng(2)
    flat = np.column_stack([rng.uniform(-1, 1, (200, 2)), np.zeros(200)])
    np.testing.assert_allclose(walk_maps(lambda x: x[:, 2], flat, np.zeros(3)), flat, atol=1e-9)
    log = log_maps.offsets(rng, 200, 1.5)
    chord, _ = log_maps.sphere(log)
    seed = np.array([0.0, 0.0, 1.0])
    found = walk_maps(lambda x: np.linalg.norm(x, axis=1) - 1, chord + seed, seed)
    np.testing.assert_allclose(found[:, :2], log, atol=2e-3)
    np.testing.assert_allclose(found[:, 2], 0, atol=1e-6)


def test_walks_end_at_sharp_edges_and_at_the_far_side() -> None:
    """Points on the seed's face have exact coordinates, those beyond the edge none."""
    points = np.array([[0.2, 0.1, 0], [-1, 2, 0], [0.3, 0, -0.4], [0.3, 1, -0.01]])
    found = walk_maps(peer_errors.edge_field, points, np.zeros(3))
    np.testing.assert_allclose(found[:2], points[:2], atol=1e-9)
    assert np.isnan(found[2:]).all()


def test_a_point_belongs_to_the_seed_with_the_shortest_walk() -> None:
    """On a plane these are Voronoi cells; behind an edge, where no walk arrives, a point has no seed."""
    rng = np.random.default_rng(3)
    seeds = np.column_stack([rng.uniform(-1, 1, (6, 2)), np.zeros(6)])
    points = np.column_stack([rng.uniform(-1, 1, (300, 2)), np.zeros(300)])
    calls = []

    def plane(x: Any) -> Any:
        calls.append(len(x))
        return x[:, 2]

    found = nearest(plane, points, seeds)
    np.testing.assert_array_equal(found.seed, np.linalg.norm(points[:, None] - seeds, axis=2).argmin(axis=1))
    np.testing.assert_allclose(found.offsets, points - seeds[found.seed], atol=1e-9)
    assert found.walks == 1
    assert sum(calls) >= 300 * 10 * STEPS
    beyond = nearest(peer_errors.edge_field, np.array([[0.3, 0.0, -0.2]]), np.zeros((1, 3)))
    assert beyond.seed.tolist() == [-1]


def test_picture_shows_what_the_methods_mark() -> None:
    """Boxes mark most, sprites what faces them, fading least; maps and seeds are next to implicit decals."""
    picture = np.asarray(peer_pictures.draw(side=60, rows=120), float)
    corners = [(64 * (number // 4), 64 * (number % 4)) for number in range(7)]
    panels = [picture[y : y + 60, x : x + 60] for y, x in corners]
    _, box, faded, sprite, cells, seeds, implicit = panels
    assert 0.0 < (box != sprite).any(axis=2).mean() < (box != faded).any(axis=2).mean() < 0.2
    away = [np.abs(panel - implicit).mean() for panel in panels]
    assert max(away[0], away[5]) < 0.5 * min(away[1:4])
    # Domes stand out over the silhouette, where all others show the white behind the torus.
    white = (implicit == 255).all(axis=2)
    assert (seeds[white] == 255).all()
    assert (cells[white] < 255).any(axis=1).sum() > 20
