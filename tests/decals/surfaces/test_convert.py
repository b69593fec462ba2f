"""Models of every kind that has a shape become surfaces and objects; all others are refused in one line."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import pyvista as pv

import blobtree
import decals
from blobtree import Point, polygonize
from decals.errors import ImplicitDecalsError, InvalidInput, InvalidMesh, InvalidScene
from decals.scenes.objects import as_object, as_objects
from decals.surfaces import MeshSurface, as_surface
from decals.surfaces.convert import as_shape
from decals.surfaces.files.ply import strip_triangles
from tests.programs import output_of

CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
TRIANGLES = [[0, 1, 2], [0, 2, 3]]
BALL = Point((0.0, 0.0, 0.0), radius=1.0)


def square(**changes: Any) -> Any:
    """A mesh as trimesh describes one: vertices of float64, faces of int64."""
    return SimpleNamespace(
        **{"vertices": np.array(CORNERS, np.float64), "faces": np.array(TRIANGLES), **changes}
    )


def tetrahedra() -> pv.UnstructuredGrid:
    grid = pv.ImageData(dimensions=(2, 2, 2))
    return grid.cast_to_unstructured_grid()


UNIT_SQUARES = {
    "arrays": (np.array(CORNERS, np.float32), np.array(TRIANGLES, np.int32)),
    "lists": (CORNERS, TRIANGLES),
    "one quad": (CORNERS, [[0, 1, 2, 3]]),
    "polygons of two sizes": (CORNERS, [[0, 1, 2], [0, 2, 3, 0]]),
    "trimesh": square(),
    "pyvista quad": pv.PolyData(np.array(CORNERS, np.float32), [4, 0, 1, 2, 3]),
    "pyvista strip": pv.PolyData(np.array(CORNERS, np.float32), strips=[4, 0, 1, 3, 2]),
    "surface": MeshSurface(np.array(CORNERS, np.float32), np.array(TRIANGLES, np.int32)),
    "object": decals.MeshObject("square", np.array(CORNERS, np.float32), np.array(TRIANGLES, np.int32)),
}


@pytest.mark.parametrize("name", UNIT_SQUARES)
def test_every_kind_of_mesh_is_the_same_square(name: str) -> None:
    assert as_surface(UNIT_SQUARES[name]).area == pytest.approx(1.0)


def test_volumes_give_their_boundary() -> None:
    assert as_surface(tetrahedra()).area == pytest.approx(6.0)
    blocks = pv.MultiBlock([pv.Cube(), pv.Cube(center=(3, 0, 0))])
    assert as_surface(blocks).area == pytest.approx(12.0)


def test_trees_and_their_meshes() -> None:
    assert as_shape(BALL) is BALL
    assert as_surface(BALL).area == pytest.approx(4 * np.pi, rel=0.02)
    assert as_surface(polygonize(BALL, resolution=40)).area == pytest.approx(4 * np.pi, rel=0.02)


def test_files(tmp_path: Path) -> None:
    pv.Cube().triangulate().save(tmp_path / "cube.ply")
    blobtree.save(BALL, tmp_path / "ball.json")
    objects = as_objects([tmp_path / "cube.ply", str(tmp_path / "ball.json"), tmp_path / "cube.ply"])
    assert [item.name for item in objects] == ["cube", "ball", "cube-2"]
    assert isinstance(objects[0], decals.MeshObject)
    assert objects[0].source == str(tmp_path / "cube.ply")
    assert isinstance(objects[1], decals.TreeObject)
    assert decals.load_model(tmp_path / "ball.json").name == "ball"  # type: ignore[union-attr]


def test_objects_are_returned_as_they_are() -> None:
    item = decals.TreeObject("ball", BALL)
    assert as_object(item, "other") is item
    assert [other.name for other in as_objects([BALL, square()])] == ["model 1", "model 2"]


def test_cover_scatter_and_render_take_every_kind() -> None:
    scene = decals.cover(pv.Sphere(), square(), BALL, count=30)
    assert len(scene.decals) == 30
    assert len(decals.scatter(pv.Cube(), count=7)) == 7
    assert len(decals.scatter([pv.Cube(), BALL], count=7)) == 7
    assert len(decals.scatter((CORNERS, TRIANGLES), count=7)) == 7
    assert len(decals.scatter(scene.objects, count=7)) == 7
    for model in (pv.Sphere(), BALL, scene, scene.objects[0], (CORNERS, TRIANGLES)):
        picture = decals.render(model, size=(24, 18), samples=1)
        assert picture.shape == (18, 24, 4)
        assert np.ptp(np.asarray(picture)[..., 0]) > 20


HOSTILE = [
    None, 5, "missing.ply", b"x", object(), {}, [], (), (1, 2), (CORNERS,), MeshSurface, pv.PolyData,
    square(faces=[]), square(faces=[[0, 1, 9]]), square(faces=[[0, 1, -1]]), square(faces=[[0.0, 1.0, 2.0]]),
    square(faces=[[0, 1]]), square(faces=None), square(faces="x"), square(vertices=None),
    square(vertices=[[0, 0]]),
    square(vertices=[[0, 0, np.nan]] * 4), square(vertices="x"), square(vertices=[[0, 0, 0]] * 4),
    square(faces=[[0, 1, 2], [0, "x", 3]]), pv.PolyData(), pv.PolyData(np.array(CORNERS, np.float32)),
    pv.Line(), (CORNERS, TRIANGLES, 3), np.zeros((3, 3)), pv.MultiBlock(),
    pv.PointSet(np.array(CORNERS, np.float32)), pv.MultiBlock([pv.PointSet(np.zeros((3, 3), np.float32))]),
    pv.MultiBlock([None]), pv.MultiBlock([pv.MultiBlock([pv.PolyData()])]),
]  # fmt: skip


@pytest.mark.parametrize("wrong", HOSTILE, ids=lambda value: type(value).__name__)
def test_all_other_values_are_refused_in_one_line(wrong: Any) -> None:
    for call in (as_surface, lambda model: decals.cover(model, count=3), decals.render):
        with pytest.raises(ImplicitDecalsError) as caught:
            call(wrong)
        assert isinstance(caught.value, InvalidInput)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", [3, 4, 5])
def test_rows_that_begin_with_their_number_of_corners_are_refused(size: int) -> None:
    """As a user takes ``mesh.faces.reshape(-1, 4)`` from pyvista."""
    ball = pv.Sphere(theta_resolution=8, phi_resolution=6)
    points = np.asarray(ball.points)
    rows = np.array([[size, *range(k, k + size)] for k in range(9)])
    with pytest.raises(InvalidMesh, match=r"give faces\[:, 1:\]"):
        as_surface((points, rows))
    with pytest.raises(InvalidMesh, match=r"give faces\[:, 1:\]"):
        as_surface((points, rows.tolist()))
    mixed = [*rows.tolist(), [size + 1, *range(size + 1)]]
    with pytest.raises(InvalidMesh, match=r"give \[row\[1:\] for row in faces\]"):
        as_surface((points, mixed))
    assert len(as_shape((points, rows[:, 1:])).faces) == 9 * (size - 2)  # type: ignore[union-attr]
    rows[3, 0] = 0
    assert len(as_shape((points, rows)).faces) == 9 * (size - 1)  # type: ignore[union-attr]
    assert len(as_shape((points, rows[:8])).faces) == 8 * (size - 1)  # type: ignore[union-attr]


def test_pyvista_faces_with_their_counts() -> None:
    ball = pv.Sphere()
    with pytest.raises(InvalidMesh, match=r"give faces\[:, 1:\]"):
        as_surface((ball.points, ball.faces.reshape(-1, 4)))
    assert as_surface((ball.points, ball.faces.reshape(-1, 4)[:, 1:])).area == pytest.approx(
        ball.area, rel=1e-4
    )


TETRAHEDRON = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def arrays_of(mesh: pv.PolyData) -> tuple[Any, Any]:
    return mesh.points, mesh.regular_faces


def grid_of_quads(count: int) -> tuple[Any, Any]:
    axis = np.arange(count + 1.0)
    points = np.stack([*np.meshgrid(axis, axis, indexing="ij"), np.zeros((count + 1, count + 1))], axis=-1)
    first = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    return points.reshape(-1, 3), np.stack([first, first + count + 1, first + count + 2, first + 1], axis=1)


@pytest.mark.parametrize(
    "mesh",
    [
        arrays_of(pv.Sphere(theta_resolution=8, phi_resolution=6)),
        arrays_of(pv.Plane(i_resolution=4, j_resolution=3).triangulate()),
        TETRAHEDRON,
        arrays_of(pv.Cube().clean()),
        arrays_of(pv.Icosahedron()),
        grid_of_quads(4),
    ],
    ids=["ball", "sheet", "tetrahedron", "cube", "icosahedron", "quads"],
)
def test_transposed_faces_are_refused(mesh: tuple[Any, Any]) -> None:
    points, faces = np.asarray(mesh[0]), np.asarray(mesh[1])
    as_surface((points, faces))
    for columns in (faces.T, np.ascontiguousarray(faces.T), faces.T.tolist()):
        with pytest.raises(
            InvalidMesh, match=rf"{faces.shape[1]} rows whose {len(faces)} columns .*; give faces\.T"
        ):
            as_surface((points, columns))


@pytest.mark.parametrize("mesh", [pv.Sphere(), grid_of_quads(4)], ids=["ball", "quads"])
def test_transposed_faces_with_counts_are_refused(mesh: Any) -> None:
    points, faces = (mesh.points, mesh.regular_faces) if isinstance(mesh, pv.PolyData) else mesh
    counted = np.insert(np.asarray(faces), 0, np.shape(faces)[1], axis=1)
    with pytest.raises(InvalidMesh, match=r"begin with the number of their corners; give faces\[1:\]\.T"):
        as_surface((np.asarray(points), counted.T))


def test_a_few_polygons_with_many_corners_are_no_transposed_faces() -> None:
    """Hexagons of a truncated tetrahedron, quads around a corner of a cube, and twelve corners each."""
    solid = pv.Icosahedron()
    corners = np.asarray(solid.points)
    hexagons = [[0, 1, 2, 3, 4, 5], [0, 5, 6, 7, 8, 9], [1, 9, 8, 10, 11, 2], [3, 11, 10, 7, 6, 4]]
    assert len(as_shape((corners, np.array(hexagons))).faces) == 4 * 4  # type: ignore[union-attr]
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = np.array([[0, 1, 3, 2], [0, 4, 5, 1], [0, 2, 6, 4]])
    assert as_surface((cube, quads)).area == pytest.approx(3.0)
    padded = np.array([[0, 1, 3, 3], [1, 3, 2, 2], [3, 2, 0, 0]])
    assert len(as_shape((cube, padded)).faces) >= 3  # type: ignore[union-attr]
    rings = np.concatenate(
        [np.c_[np.cos(t := np.arange(12) * np.pi / 6), np.sin(t), np.full(12, z)] for z in range(3)]
    )
    assert as_surface((rings, np.arange(36).reshape(3, 12))).area == pytest.approx(9.0)


def test_messages_name_the_model() -> None:
    with pytest.raises(InvalidScene, match=r"model 2: expected a model, got 5; give a BlobTree"):
        decals.cover(BALL, 5)  # type: ignore[arg-type]
    with pytest.raises(InvalidMesh, match=r"surface: expected faces as rows of whole numbers"):
        as_surface(square(faces=[[0.5, 1, 2]]))


def ply_with_strips(rows: str, count: int) -> str:
    return (
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        f"element tristrips {count}\nproperty list int int vertex_indices\nend_header\n"
        f"0 0 0\n1 0 0\n0 1 0\n1 1 0\n{rows}\n"
    )


@pytest.mark.parametrize(
    ("rows", "count", "area"),
    [("4 0 1 2 3", 1, 1.0), ("7 0 1 2 -1 1 3 2", 1, 1.0), ("3 0 1 2\n3 1 3 2", 2, 1.0), ("3 0 1 2", 1, 0.5)],
)
def test_ply_strips_are_read(tmp_path: Path, rows: str, count: int, area: float) -> None:
    path = tmp_path / "strips.ply"
    path.write_text(ply_with_strips(rows, count))
    surface = as_surface(path)
    assert surface.area == pytest.approx(area)
    np.testing.assert_allclose(surface.normal([[0.2, 0.2, 0.0], [0.8, 0.8, 0.0]])[:, 2], 1.0)


def test_strips_that_are_too_short_or_wrong(tmp_path: Path) -> None:
    assert strip_triangles(np.array([0, 1, -1, 2])).shape == (0, 3)
    np.testing.assert_array_equal(strip_triangles(np.array([0, 1, 2, 3])), [[0, 1, 2], [2, 1, 3]])
    path = tmp_path / "bad.ply"
    path.write_text(ply_with_strips("3 0 1 9", 1))
    with pytest.raises(InvalidMesh):
        as_surface(path)


def test_meshes_of_arrays_need_no_pyvista() -> None:
    """Its import takes longer than all of ours."""
    program = """
import sys
from decals.surfaces.convert import as_surface
as_surface(([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
print({"pyvista", "vtkmodules"} & sys.modules.keys())
"""
    assert output_of(program).strip() == "set()"
