"""Layouts of textures: charts keep areas, overlap nowhere, and the shortest seams are chosen."""

import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

import blobtree
import decals
from decals.baking import layouts as layouts_module
from decals.baking.layouts import lay_out
from decals.baking.meshes import BakeMesh, bake_mesh
from decals.baking.packing import pack
from decals.baking.seams import STEP, Seams
from decals.baking.surface_colors import SurfaceColors
from decals.baking.texture import Channels, Sheet, bake_texture
from decals.baking.unwrapped import Unwrapped
from decals.child_process import can_isolate
from decals.errors import Cancelled, InvalidMesh
from decals.surfaces import BaseColor, BaseTexture
from tests.decals.baking.glb import (
    BALL,
    Array,
    ball_and_cube,
    bilinear,
    expected_colors,
    linear,
    need,
    read_glb,
)
from tests.decals.baking.seam_steps import srgb

SIZE = 512


def silent(*_: Any) -> None:
    """Report nothing."""


def bake_meshes(*objects: Any) -> list[BakeMesh]:
    scene = decals.cover([*objects], count=2)
    return [bake_mesh(item, resolution=24, creases=True, report=silent) for item in scene.objects]


def blob(seed: int) -> Any:
    """Random points that blend, some cut away."""
    rng = np.random.default_rng(seed)
    parts = [
        blobtree.Point(tuple(rng.uniform(-1, 1, 3)), radius=float(rng.uniform(0.4, 0.9))) for _ in range(4)
    ]
    tree: Any = parts[0] + parts[1] | parts[2]
    return tree - parts[3] if seed % 2 else tree & blobtree.Point((0, 0, 0), radius=1.2)


def spiral(turns: float = 2.5) -> pv.PolyData:
    """A ramp that lies over itself, seen along its axis."""
    angle, radius = np.meshgrid(np.linspace(0, turns * 2 * np.pi, 120), np.linspace(0.5, 1.0, 6))
    grid: Any = pv.StructuredGrid(radius * np.cos(angle), radius * np.sin(angle), 0.1 * angle)
    surface: pv.PolyData = grid.extract_surface(algorithm="dataset_surface").triangulate()
    return surface


def total_areas(mesh: BakeMesh, part: Unwrapped) -> tuple[Array, Array]:
    corners, places = mesh.vertices[mesh.faces].astype(float), part.places[part.faces].astype(float)
    solid = 0.5 * np.linalg.norm(np.cross(*np.moveaxis(np.diff(corners, axis=1), 1, 0)), axis=1)
    return solid, 0.5 * np.linalg.det(np.diff(places, axis=1))


def check(mesh: BakeMesh, part: Unwrapped, size: int) -> None:
    """All faces once, upright, about as large as on the surface, within the texture, none over another."""
    assert np.array_equal(part.rows[part.faces], mesh.faces)
    assert part.places.min() >= 0
    assert part.places.max() <= size
    solid, flat = total_areas(mesh, part)
    assert (flat < 0).all() or (flat > 0).all()  # no face is mirrored
    density = np.sqrt(np.abs(flat) / solid * solid.sum() / np.abs(flat).sum())
    assert np.quantile(density, [0.02, 0.98]).min() > 0.4
    sheet = Sheet(0, mesh, part, 0)
    found, overlaps = sheet.cover(size, margin=-0.05)
    assert overlaps == 0
    assert (found >= 0).mean() > 0.2


@pytest.mark.slow_cases("1", "2", "3")
@pytest.mark.parametrize("seed", range(4))
def test_box_atlases_of_blobs(seed: int) -> None:
    (mesh,) = bake_meshes(blob(seed))
    (part,) = lay_out([mesh], SIZE, "box", 1, silent)
    check(mesh, part, SIZE)


@pytest.mark.parametrize(
    "surface",
    [pv.Cube().triangulate(), pv.ParametricTorus(u_res=30, v_res=30).triangulate().clean(), spiral()],
    ids=["cube", "torus", "spiral"],
)
def test_box_atlases_of_meshes(surface: Any) -> None:
    (mesh,) = bake_meshes(surface)
    (part,) = lay_out([mesh], SIZE, "box", 1, silent)
    check(mesh, part, SIZE)


def test_the_seams_of_a_box_are_its_edges_and_those_of_charts_are_cut_once() -> None:
    (mesh,) = bake_meshes(pv.Cube().triangulate())
    (part,) = lay_out([mesh], SIZE, "box", 1, silent)
    seams = Seams.of([mesh], [part])
    assert seams.length == pytest.approx(12.0, rel=1e-5)
    assert len(seams.faces) == 12
    lengths = np.linalg.norm(seams.ends[:, :, 1] - seams.ends[:, :, 0], axis=2)
    assert np.ptp(lengths) < 0.01 * lengths.mean()


@pytest.mark.parametrize("seed", range(5))
def test_edges_of_several_faces_are_seams_between_each_and_the_next(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.array([rng.permutation(6)[:3] for _ in range(12)])  # each with vertices of its own
    points = rng.normal(size=(6, 3)).astype(np.float32)[corners.reshape(-1)]
    faces = np.arange(36, dtype=np.int32).reshape(-1, 3)
    mesh = BakeMesh("fans", points, faces, points, (1.0, 1.0, 1.0), points, points)
    places = rng.uniform(0.0, SIZE, (36, 2)).astype(np.float32)
    seams = Seams.of([mesh], [Unwrapped(np.arange(36), faces, places, np.zeros(12, np.int32))])
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2))
    assert len(seams.faces) == 36 - len(np.unique(ends, axis=0))
    assert np.array_equal(seams.corners // 3, np.repeat(seams.faces[..., None], 3, axis=2))
    assert np.array_equal(seams.ends, places[seams.corners[..., :2]])
    assert np.array_equal(points[seams.corners[:, 0, :2]], points[seams.corners[:, 1, :2]])


@pytest.mark.parametrize("seed", range(5))
def test_between_points_of_seams_the_same_texels_are_mixed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ends = rng.uniform(1.0, 30.0, (8, 2, 2, 2))
    ends[0] = np.round(ends[0]) + 0.5  # at the middles of texels
    ends[1, 0, 1, 0] = ends[1, 0, 0, 0]  # along a column
    faces = np.zeros((8, 2), np.int64)
    numbers, places = Seams(faces[:, 0], faces, faces, ends, np.zeros((8, 2, 3), np.int64), 0.0).points()
    for seam, (begin, end) in enumerate(np.moveaxis(ends, 2, 1)):
        own = places[numbers == seam]
        assert own[0] == pytest.approx(begin)
        assert own[-1] == pytest.approx(end)
        assert np.linalg.norm(np.diff(own, axis=0), axis=2).max() <= STEP + 1e-9
        near, far = (own[:-1] + np.diff(own, axis=0) * share for share in (1e-3, 1.0 - 1e-3))
        apart = np.linalg.norm(own[1:] - own[:-1], axis=2).max(axis=1) > 1e-6
        assert np.array_equal(np.floor(near - 0.5)[apart], np.floor(far - 0.5)[apart])


@pytest.mark.parametrize("seed", range(5))
def test_rectangles_are_packed_apart(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sides, tiles = rng.uniform(0.1, 1.0, (30, 2)), 1 + seed % 2
    scale, corners, squares = pack(sides, 0.01, tiles)
    upper = corners + scale * sides
    assert corners.min() >= 0.005
    assert upper.max() <= 0.995
    assert scale**2 * sides.prod(axis=1).sum() > 0.5 * tiles
    for a in range(len(sides)):
        for b in range(a):
            gap = np.maximum(corners[a] - upper[b], corners[b] - upper[a]).max()
            assert squares[a] != squares[b] or gap >= 0.01 - 1e-9


def test_rectangles_that_do_not_fit_have_no_scale() -> None:
    assert pack(np.ones((300, 2)), 0.1, 1)[0] == 0.0


def textured_grid(offset: float = 0.0, fold: bool = False) -> decals.MeshObject:
    """A square with texture coordinates: its own plane, moved, or folded over itself."""
    plane = pv.Plane(i_resolution=8, j_resolution=8).triangulate()
    uv = plane.points[:, :2] + 0.5 + offset
    if fold:
        uv[:, 0] = np.abs(uv[:, 0] - 0.5)
    color = BaseColor(coordinates=uv, textures=(BaseTexture("tile"),))
    return decals.MeshObject("plane", plane.points, plane.regular_faces, color)


def revolved(radii: Array, heights: Array, sides: int) -> decals.MeshObject:
    """A surface of revolution with many sides, open at both ends, or closed where a radius is 0."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate(
        [
            np.pad(radius * around, ((0, 0), (0, 1)), constant_values=height)
            for radius, height in zip(radii, heights, strict=True)
        ]
    )
    first = (np.arange(len(radii) - 1)[:, None] * (sides + 1) + np.arange(sides)).reshape(-1)
    lower, upper = (first, first + 1, first + sides + 2), (first, first + sides + 2, first + sides + 1)
    mesh = pv.PolyData.from_regular_faces(points, np.concatenate([np.stack(lower, 1), np.stack(upper, 1)]))
    clean: Any = mesh.clean(tolerance=1e-7)
    return decals.MeshObject("revolved", clean.points, clean.triangulate().regular_faces)


def smooth_surface(name: str) -> decals.MeshObject:
    """A smooth surface whose neighbouring faces have nearly one normal."""
    t = np.linspace(0.0, 1.0, 300)
    if name == "tube":
        return revolved(np.ones(2), np.array([0.0, 2.0]), 1000)
    if name == "cone":
        return revolved(np.array([0.0, 1.0]), np.array([0.0, 2.0]), 600)
    if name == "ball":
        return revolved(np.sin(np.pi * t), np.cos(np.pi * t), 240)
    if name == "spiral":
        surface = spiral()
        return decals.MeshObject("spiral", surface.subdivide(2).points, surface.subdivide(2).regular_faces)
    rng = np.random.default_rng(int(name))
    radii = np.full(len(t), 0.7)
    for frequency in range(1, 6):
        radii += rng.uniform(-0.1, 0.1) * np.cos(frequency * np.pi * t + rng.uniform(0.0, 6.0))
    return revolved(radii, 2.0 * t, int(rng.integers(200, 500)))


@pytest.mark.slow_cases("cone", "ball", "spiral", "1", "2")
@pytest.mark.parametrize("name", ["tube", "cone", "ball", "spiral", "1", "2"])
def test_xatlas_presses_no_smooth_surface_flat(name: str) -> None:
    """Neighbours with nearly one normal are a plane for xatlas: it crashes, or halves lie over each other."""
    need("xatlas")
    mesh = bake_mesh(smooth_surface(name), resolution=None, creases=False, report=silent)
    (part,) = lay_out([mesh], SIZE, "xatlas", 1, silent)
    assert np.array_equal(part.rows[part.faces], mesh.faces)
    solid, flat = total_areas(mesh, part)
    density = np.sqrt(np.abs(flat) / solid * solid.sum() / np.abs(flat).sum())
    assert np.quantile(density, 0.02) > 0.4
    _, overlaps = Sheet(0, mesh, part, 0).cover(SIZE, margin=-0.05)
    assert overlaps <= 1e-4 * len(mesh.faces)


@pytest.mark.skipif(not can_isolate(), reason="xatlas has no process of its own here")
def test_a_crash_of_xatlas_is_an_error_of_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    need("xatlas")
    start = subprocess.Popen

    def crashed(*arguments: Any, **options: Any) -> Any:
        child = start(*arguments, **options)
        child.send_signal(signal.SIGSEGV)
        return child

    monkeypatch.setattr(subprocess, "Popen", crashed)
    with pytest.raises(InvalidMesh, match=r"xatlas could not unwrap the surface \(exit code -11\); repair"):
        lay_out(bake_meshes(pv.Cube().triangulate()), SIZE, "xatlas", 1, silent)


def test_a_surface_that_xatlas_lays_over_itself_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    (mesh,) = bake_meshes(pv.Cube().triangulate())
    (part,) = lay_out([mesh], SIZE, "box", 1, silent)
    turned = part.rows[part.faces]  # each face lies where the first one does
    flat = Unwrapped(
        turned.reshape(-1),
        np.arange(3 * len(turned), dtype=np.int32).reshape(-1, 3),
        np.tile(part.places[part.faces[0]], (len(turned), 1)),
        part.tile_of_face,
    )
    monkeypatch.setattr(layouts_module, "unwrap", lambda *_: [flat])
    with pytest.raises(InvalidMesh, match="layout 'xatlas': parts of the surface lie over others"):
        lay_out([mesh], SIZE, "xatlas", 1, silent)


def test_own_coordinates_stay_as_they_are(tmp_path: Path) -> None:
    need("trimesh")
    item = textured_grid()
    decals.bake(item, tmp_path / "a.glb", size=64, layout="own")
    node = read_glb(tmp_path / "a.glb")["plane"]
    assert node.uv is not None
    assert node.texture is not None
    np.testing.assert_allclose(node.uv, node.vertices[:, :2] + 0.5, atol=1e-6)
    tile = decals.surfaces.BaseTexture("tile")
    uv = np.random.default_rng(1).uniform(0.05, 0.95, (400, 2))
    off = np.abs(bilinear(linear(node.texture / 255.0), uv) - tile.light_at(uv)).max(axis=1)
    assert np.median(off) < 0.02


def test_several_objects_share_a_texture_by_their_own_coordinates() -> None:
    meshes = bake_meshes(textured_grid(), textured_grid(), textured_grid())
    parts = lay_out(meshes, SIZE, "own", 1, silent)
    cells = {tuple((part.places.mean(axis=0) // (SIZE / 2)).tolist()) for part in parts}
    assert len(cells) == 3
    parts = lay_out(meshes, SIZE, "own", 3, silent)
    assert [part.tile_of_face[0] for part in parts] == [0, 1, 2]


@pytest.mark.parametrize(
    ("item", "says"),
    [
        (textured_grid(offset=0.3), "those of object 'plane' go from 0.3 to 1.3; use layout='box'"),
        (textured_grid(fold=True), "faces of object 'plane' lie over others in its texture coordinates"),
    ],
    ids=["outside", "folded"],
)
def test_own_coordinates_that_cannot_be_used_are_refused(tmp_path: Path, item: Any, says: str) -> None:
    need("trimesh")
    with pytest.raises(InvalidMesh, match=says):
        decals.bake(item, tmp_path / "a.glb", size=64, layout="own")
    decals.bake(item, tmp_path / "b.glb", size=64)
    assert [path.name for path in tmp_path.iterdir()] == ["b.glb"]


def test_own_coordinates_without_area_are_refused() -> None:
    item = textured_grid()
    assert isinstance(item.color, BaseColor)
    flat = BaseColor(coordinates=np.zeros((len(item.vertices), 2)), textures=item.color.textures)
    meshes = bake_meshes(decals.MeshObject("plane", item.vertices, item.faces, flat))
    with pytest.raises(InvalidMesh, match="128 of 128 faces of object 'plane' have no area"):
        lay_out(meshes, SIZE, "own", 1, silent)


def test_auto_takes_the_shorter_seams(monkeypatch: pytest.MonkeyPatch) -> None:
    """Own coordinates of a plane have none; a box atlas of a ball has fewer than xatlas."""
    meshes = bake_meshes(textured_grid())
    (part,) = lay_out(meshes, SIZE, "auto", 1, silent)
    assert np.array_equal(part.places, lay_out(meshes, SIZE, "own", 1, silent)[0].places)
    ball = bake_meshes(blobtree.Point((0, 0, 0), radius=1.0))
    made = lay_out(ball, SIZE, "auto", 1, silent)
    assert np.array_equal(made[0].places, lay_out(ball, SIZE, "box", 1, silent)[0].places)
    need("xatlas")
    xatlas = lay_out(ball, SIZE, "xatlas", 1, silent)
    assert Seams.of(ball, made).length < Seams.of(ball, xatlas).length
    monkeypatch.setattr(layouts_module, "_boxes", lambda *_: None)
    assert np.array_equal(lay_out(ball, SIZE, "auto", 1, silent)[0].places, xatlas[0].places)
    with pytest.raises(InvalidMesh, match="layout 'box': expected a surface that needs at most 1000 charts"):
        lay_out(ball, SIZE, "box", 1, silent)


def test_layouts_end_when_they_are_cancelled(tmp_path: Path) -> None:
    need("trimesh", "xatlas")
    for layout in ("box", "xatlas"):
        stages: list[str] = []

        def note(stage: str, _: float, stages: list[str] = stages) -> None:
            stages.append(stage)

        def cancel(stages: list[str] = stages) -> bool:
            return "unwrapping the surface" in stages

        with pytest.raises(Cancelled, match="unwrapping the surface"):
            decals.bake(
                ball_and_cube(count=4),
                tmp_path / "a.glb",
                size=32,
                layout=layout,
                progress=note,
                cancel=cancel,
            )
    assert not list(tmp_path.iterdir())


def test_tiles_are_nodes_with_textures_of_their_own(tmp_path: Path) -> None:
    need("trimesh")
    scene = ball_and_cube()
    checks = decals.export(scene, tmp_path / "a.glb", size=96, samples=1, tiles=3)
    assert [check.closed for check in checks] == [True, True]
    nodes = read_glb(tmp_path / "a.glb")
    assert {name.split(".")[0] for name in nodes} == {"ball", "cube"}
    assert len({name.split(".")[1] for name in nodes}) == 3
    faces = sum(len(node.faces) for name, node in nodes.items() if name.startswith("ball"))
    whole = decals.export(scene, tmp_path / "b.glb", size=96, samples=1)
    single = read_glb(tmp_path / "b.glb")
    assert faces == len(single["ball"].faces)
    assert [check.closed for check in whole] == [True, True]
    errors = {}
    for key, every in (("tiles", nodes), ("one", single)):
        found = []
        for name, node in every.items():
            if not name.startswith("ball"):
                continue
            points, normals, uv = node.on_surface(1500)
            assert node.texture is not None
            assert node.texture.shape == (96, 96, 3)
            want = expected_colors(scene, BALL, points, normals)
            found.append(np.abs(bilinear(linear(node.texture / 255), uv) - want).max(axis=1))
        errors[key] = np.median(np.concatenate(found))
    assert errors["tiles"] < 0.8 * errors["one"]  # three times as many texels


def test_obj_files_name_their_tiles_as_udim_does(tmp_path: Path) -> None:
    need("trimesh")
    decals.export(ball_and_cube(count=4), tmp_path / "a.obj", size=32, samples=1, tiles=3)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"a.obj", "a.mtl", *(f"a_color.{number}.png" for number in (1001, 1002, 1003))}
    lines = (tmp_path / "a.obj").read_text().splitlines()
    used = {line.split()[1] for line in lines if line.startswith("usemtl")}
    assert used == {"baked.1001", "baked.1002", "baked.1003"}
    places = np.array([line.split()[1:] for line in lines if line.startswith("vt ")], float)
    tile = None
    for line in lines:
        if line.startswith("usemtl"):
            tile = int(line[-1]) - 1
        elif line.startswith("f "):
            corners = [int(corner.split("/")[1]) - 1 for corner in line.split()[1:]]
            assert (np.floor(places[corners].mean(axis=0)) == [tile, 0]).all()


def test_seams_between_tiles_agree_too() -> None:
    scene = ball_and_cube()
    meshes = [bake_mesh(item, resolution=None, creases=False, report=silent) for item in scene.objects[:1]]
    colors = SurfaceColors(meshes, scene.objects[:1], scene.decals, scene.images, scene.drawing)
    parts = lay_out(meshes, 128, "box", 2, silent)
    images = bake_texture(meshes, parts, 128, 2, Channels(colors.at), silent)
    assert [image.shape for image in images] == 2 * [(128, 128, 3)]
    seams = Seams.of(meshes, parts)
    between = seams.tiles[:, 0] != seams.tiles[:, 1]
    assert between.any()
    rows, places = seams.points()
    levels = []
    for side in (0, 1):
        uv = places[:, side] / 128
        uv[:, 1] = 1 - uv[:, 1]
        own = seams.tiles[rows, side]
        light = [bilinear(linear(tile / 255.0), uv) for tile in images]
        levels.append(255 * srgb(np.where(own[:, None] == 0, *light)))
    assert np.abs(levels[0] - levels[1])[between[rows]].max() <= 4.0
