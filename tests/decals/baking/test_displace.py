"""Displaced surfaces: heights against decals in float64, closed meshes, short edges, files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

import decals
from blobtree import Point
from decals import DecalMaterial, Scene, TreeObject
from decals.apps.cli import run
from decals.baking.displace import DisplacedScene
from decals.errors import InvalidMesh, InvalidScene
from decals.scenes.pose import PosedMesh
from decals.surfaces import ImplicitSurface, MeshSurface, subdivide
from decals.surfaces.subdivide import subdivided
from tests.decals.baking.glb import Array, ball_and_cube, need, read_attribute, read_glb
from tests.decals.meshes import box, icosphere
from tests.decals.relief import expected_heights, hills


@pytest.fixture(scope="module")
def hilly() -> Scene:
    """A ball and a cube under layered decals: hills, hollows, and tints without image."""
    return ball_and_cube(count=30).replace(images=[hills(1, relief=0.4), hills(2, relief=-0.3)])


@pytest.fixture(scope="module")
def reports() -> list[tuple[str, float]]:
    """Progress of `moved`."""
    return []


@pytest.fixture(scope="module")
def moved(hilly: Scene, reports: list[tuple[str, float]]) -> DisplacedScene:
    return decals.displace(hilly, edge_length=0.09, progress=lambda *report: reports.append(report))


def test_progress_grows_over_all_objects(moved: DisplacedScene, reports: list[tuple[str, float]]) -> None:
    for stage in ("dividing triangles", "reading heights"):
        fractions = [fraction for name, fraction in reports if name == stage]
        assert fractions == sorted(fractions)
        assert fractions[0] < 0.5 <= fractions[-1] <= 1.0
    assert len({fraction for name, fraction in reports if name == "dividing triangles"}) > 4


def test_vertices_move_by_the_heights_of_the_decals(hilly: Scene, moved: DisplacedScene) -> None:
    for item in moved.objects:
        assert isinstance(item, PosedMesh)
        steps = item.vertices.astype(float) - item.rest.vertices
        ball = item.name == "ball"
        normals = item.rest.vertices / np.linalg.norm(item.rest.vertices, axis=1, keepdims=True)
        if not ball:  # within its faces
            normals = np.round((item.rest.vertices - [1.5, 0, 0]) / 0.6 * 0.501)
        inner = np.abs(normals).sum(axis=1) == 1 if not ball else np.ones(len(normals), np.bool_)
        want = expected_heights(hilly, item.rest.vertices[inner], normals[inner])
        got = np.einsum("ij,ij->i", steps[inner], normals[inner])
        off = np.abs(got - want)
        assert np.ptp(want) > 0.1
        assert np.quantile(off, 0.99) < (3e-3 if ball else 2e-5)  # normals of the ball's mesh are not exact
        across = steps[inner] - got[:, None] * normals[inner]
        assert np.abs(across).max() < (6e-3 if ball else 1e-6)


def test_heights_follow_the_walked_mapping(hilly: Scene) -> None:
    moved = decals.displace(hilly, edge_length=0.2, mapping="walked")
    walks = decals.field.Walks.over(hilly.decals, hilly.objects)
    (cube,) = (item for item in moved.objects if item.name != "ball")
    assert isinstance(cube, PosedMesh)
    steps = cube.vertices.astype(float) - cube.rest.vertices
    normals = np.round((cube.rest.vertices - [1.5, 0, 0]) / 0.6 * 0.501)
    inner = np.abs(normals).sum(axis=1) == 1
    points = hilly.decals, cube.rest.vertices[inner], normals[inner]
    walked, corrected = (
        decals.evaluate(*points, images=hilly.images, on=cube.rest, mapping=mapping, walks=walks).height
        for mapping in ("walked", "corrected")
    )
    assert walked is not None
    assert corrected is not None
    np.testing.assert_allclose(np.einsum("ij,ij->i", steps[inner], normals[inner]), walked, atol=1e-6)
    assert np.abs(walked - corrected).max() > 0.01


def test_a_closed_object_stays_closed_and_edges_are_short(hilly: Scene, moved: DisplacedScene) -> None:
    for item in moved.objects:
        assert isinstance(item, PosedMesh)
        assert MeshSurface(item.vertices, item.faces).closed
        corners = item.rest.vertices[item.faces].astype(float)
        edges = np.roll(corners, -1, axis=1) - corners
        lengths = np.linalg.norm(edges, axis=2).reshape(-1)
        middles = (corners + 0.5 * edges).reshape(-1, 3)
        raised = hilly.decals[hilly.decals.images >= 0]
        gaps = np.linalg.norm(middles[:, None] - raised.positions, axis=2) - raised.radii
        assert lengths[gaps.min(axis=1) < 0].max() <= 0.09
        assert len(item.faces) == 2 * (len(item.vertices) - 2)  # a sphere: no vertex of its own at a crease


def test_a_tree_moves_from_its_exact_surface() -> None:
    ball = TreeObject("ball", Point((0, 0, 0), radius=1.0, color=(0.9, 0.1, 0.1)))
    stud = DecalMaterial("stud", np.ones((16, 16, 3)), height=np.ones((16, 16)), relief=0.5)
    one = decals.Decals([[0, 0, 1.0]], [[0, 0, 1.0]], [[1.0, 0, 0]], [0.4])
    scene = Scene(objects=[ball], camera=decals.Camera((0, 0, 5)), decals=one, images=stud)
    shown = decals.displace(scene, resolution=12)
    item = shown.objects[0]
    assert isinstance(item, PosedMesh)
    np.testing.assert_allclose(np.linalg.norm(item.rest.vertices, axis=1), 1.0, atol=1e-5)
    assert np.linalg.norm(item.vertices, axis=1).max() == pytest.approx(1.2, abs=1e-4)
    surface = shown.to_polydata()
    assert surface.is_manifold
    far = surface.points[:, 2] < 0
    np.testing.assert_array_equal(surface["RGB"][far][0], [230, 26, 26])
    np.testing.assert_array_equal(surface["RGB"][surface.points[:, 2].argmax()], [255, 255, 255])


@given(st.integers(0, 2**32 - 1), st.sampled_from(["ball", "box"]))
def test_subdivision_of_any_edges_leaves_no_crack(seed: int, shape: str) -> None:
    """Also between copies of vertices at creases, whose edges run in either direction."""
    vertices, faces = icosphere(1) if shape == "ball" else (box().vertices, box().faces)
    corners = vertices[faces].reshape(-1, 3)  # each face has its own vertices
    rng = np.random.default_rng(seed)
    direction, least = rng.normal(size=3), rng.uniform(0.2, 1.0)

    def is_long(starts: Array, ends: Array) -> Any:
        middle = 0.5 * (starts + ends)
        return np.linalg.norm(starts - ends, axis=1) > least + np.abs(middle @ direction)

    rows, finer = subdivided(corners.astype(float), np.arange(len(corners)).reshape(-1, 3), is_long)
    surface = MeshSurface(rows, finer)
    assert surface.closed
    assert surface.area == pytest.approx(MeshSurface(vertices, faces).area, rel=1e-5)
    assert len(surface.sound) == len(finer)
    edges = rows[finer], rows[np.roll(finer, -1, axis=1)]
    assert not is_long(*(ends.reshape(-1, 3) for ends in edges)).any()


def test_textures_of_a_posed_mesh_have_the_colours_of_its_rest_pose(tmp_path: Path) -> None:
    need("trimesh", "xatlas")
    half = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    sheet = decals.MeshObject("sheet", half, [[0, 1, 2], [0, 2, 3]], (1.0, 1.0, 1.0))
    spot = decals.Decals([[0.0, 0, 0]], [[0, 0, 1.0]], [[1.0, 0, 0]], [0.5], images=[-1], tints=[[1.0, 0, 0]])
    scene = Scene(objects=[sheet], camera=decals.Camera((0, 0, 5)), decals=spot)
    posed = decals.pose(scene, {"sheet": half * [3, 3, 1] + [5, 0, 0]})
    decals.bake(posed, tmp_path / "posed.glb", size=64)
    node = read_glb(tmp_path / "posed.glb")["sheet"]
    assert node.texture is not None
    assert node.uv is not None
    assert node.vertices[:, 0].min() == 5.0
    rng = np.random.default_rng(1)
    weights = rng.dirichlet((1, 1, 1), 200)
    corners = node.faces[rng.integers(0, 2, 200)]
    points, uv = (np.einsum("ij,ijk->ik", weights, rows[corners]) for rows in (node.vertices, node.uv))
    texels = node.texture[((1 - uv[:, 1]) * 64).astype(int), (uv[:, 0] * 64).astype(int)]
    distance = np.linalg.norm((points - [5, 0, 0]) / 3, axis=1)
    assert (texels[distance < 0.45] == [255, 0, 0]).all()
    assert (texels[distance > 0.55] == 255).all()


def test_a_surface_that_jumps_is_divided_to_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def jumping(_: ImplicitSurface, points: Array) -> tuple[Array, Array]:
        return np.add(points, [0.0, 0.0, 0.05]), np.tile([0.0, 0.0, 1.0], (len(points), 1))

    scene = decals.cover(Point((0, 0, 0), radius=1.0), count=20, images=[hills(1, relief=0.4)])
    monkeypatch.setattr(ImplicitSurface, "project", jumping)
    monkeypatch.setattr(subdivide, "MAX_FACES", 50_000)
    (item,) = decals.displace(scene, edge_length=0.04).objects
    assert isinstance(item, PosedMesh)
    corners = item.rest.vertices[item.rest.faces].astype(float)
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() < 0.2


def test_too_many_triangles_are_refused(monkeypatch: pytest.MonkeyPatch, hilly: Scene) -> None:
    monkeypatch.setattr(subdivide, "MAX_FACES", 5000)
    with pytest.raises(InvalidMesh, match="expected at most 5,000 triangles"):
        decals.displace(hilly, edge_length=0.01)
    corners = np.eye(3)
    with pytest.raises(InvalidMesh, match="edges so short need more"):
        subdivided(corners, np.array([[0, 1, 2]]), lambda starts, _: np.ones(len(starts), np.bool_))
    monkeypatch.setattr("decals.baking.displace.subdivided", lambda *_: pytest.fail("triangles were divided"))
    for length in (0.01, 1e-6, 1e-300):
        with pytest.raises(InvalidMesh, match="edges so short need about"):
            decals.displace(hilly, edge_length=length)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"edge_length": 0.0}, "edge_length: expected a length above 0, got 0.0"),
        ({"edge_length": np.nan}, "edge_length"),
        ({"creases": 3}, "creases"),
        ({"contact": "soft"}, "contact"),
        ({"scene": ball_and_cube(count=4)}, "expected a decal whose image has relief, got none"),
    ],
)
def test_wrong_arguments_are_refused(hilly: Scene, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidScene, match=message):
        decals.displace(**{"scene": hilly, **change})


def test_files(
    hilly: Scene, moved: DisplacedScene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    need("trimesh")
    monkeypatch.chdir(tmp_path)
    decals.save_scene(hilly, "scene.json")
    assert run(["displace", "scene.json", "--edge-length", "0.09", "-o", "hills.ply"]) == 0
    assert capsys.readouterr().out == "hills.ply\n"
    read: Any = pv.read("hills.ply")
    whole = moved.to_polydata()
    np.testing.assert_array_equal(read.points, whole.points)
    np.testing.assert_array_equal(read["RGB"], whole["RGB"])
    moved.save("hills.glb")
    ball = moved.objects[0]
    assert isinstance(ball, PosedMesh)
    np.testing.assert_array_equal(read_attribute(Path("hills.glb"), 0, "POSITION"), ball.vertices)
    with pytest.raises(InvalidScene, match=r"ends in \.glb or \.ply"):
        moved.save("hills.txt")
    assert run(["displace", "nowhere.json", "-o", "hills.ply"]) == 2
