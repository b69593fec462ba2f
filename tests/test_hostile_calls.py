"""Wrong arguments, file names and PLY headers, each of which raised an exception of another library."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blobtree
import decals
from blobtree import Point
from decals.editing import (
    BrushDecals,
    EditSession,
    GroupOperands,
    MapValues,
    MoveBranch,
    MovePrimitive,
    ScaleDecals,
    SetParameter,
    SetValues,
    recovery_path,
)
from decals.errors import ImplicitDecalsError
from decals.index import DecalIndex
from decals.scattering import Creases
from decals.scenes.objects import bounds_of
from decals.surfaces import ImplicitSurface, MeshSurface, as_surface, read_mesh

HUGE = 10**400
ENDLESS = 10**6000
"""A number that Python refuses to print."""

BALL = Point((0, 0, 0), radius=1.0)
TRIANGLE: Any = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
SPOTS = decals.Decals([[0, 0, 1]] * 3, [[0, 0, 1]] * 3, [[1, 0, 0]] * 3, [0.1] * 3, images=[-1] * 3)
CAMERA = decals.Camera((0, 0, 4), (0, 0, 0))
SCENE = decals.Scene(objects=(decals.TreeObject("ball", BALL),), camera=CAMERA, decals=SPOTS)
WRONG: Any = object()
"""A value of no kind that is expected anywhere."""

CALLS: dict[str, Callable[[], object]] = {
    "radius": lambda: Point((0, 0, 0), radius=HUGE),
    "endless radius": lambda: Point((0, 0, 0), radius=ENDLESS),
    "centre": lambda: Point((HUGE, 0, 0), radius=1.0),
    "scale": lambda: BALL.scale(HUGE),
    "angle": lambda: BALL.rotate((0, 0, 1), HUGE),
    "matrix": lambda: BALL.transform([[HUGE] * 4] * 3),
    "resolution": lambda: blobtree.polygonize(BALL, resolution=HUGE),
    "cell size": lambda: blobtree.polygonize(BALL, cell_size=HUGE),
    "creases": lambda: blobtree.polygonize(BALL, creases=np.zeros(3)),  # type: ignore[arg-type]
    "creases within an error": lambda: blobtree.polygonize(BALL, chord_error=0.1, creases=WRONG),
    "adaptive": lambda: blobtree.polygonize(BALL, chord_error=0.1, adaptive=np.zeros(3)),  # type: ignore[arg-type]
    "endless grid": lambda: blobtree.sample(BALL, spacing=5e-324),
    "large grid": lambda: blobtree.sample(BALL, spacing=1e-30),
    "quick": lambda: EditSession(SCENE).do(SetParameter(0, (), "radius", 1.0, quick=WRONG)),
    "device of a tree": lambda: ImplicitSurface(BALL).on("nope"),
    "device of a mesh": lambda: MeshSurface(*TRIANGLE).on("nope"),
    "no device": lambda: MeshSurface(*TRIANGLE).on(WRONG),
    "row": lambda: SPOTS[3],
    "rows": lambda: SPOTS[[0, 99]],
    "text as row": lambda: SPOTS["a"],
    "fraction as row": lambda: SPOTS[[0.5]],
    "short mask": lambda: SPOTS[[True]],
    "None as row": lambda: SPOTS[WRONG],
    "slice of text": lambda: SPOTS[slice("a", "b")],
    "index of no decals": lambda: DecalIndex.of(WRONG),
    "bounds of none": lambda: bounds_of(WRONG),
    "bounds of text": lambda: bounds_of("ball"),  # type: ignore[arg-type]
    "framing of none": lambda: decals.Camera.framing(WRONG),
    "framing of objects": lambda: decals.Camera.framing(SCENE.objects),  # type: ignore[arg-type]
    "framing of a line": lambda: decals.Camera.framing((np.zeros(3), np.ones(3)), aspect=5e-324),
    "framing of complex numbers": lambda: decals.Camera.framing(np.zeros(3, complex)),  # type: ignore[arg-type]
    "endless sample": lambda: as_surface(TRIANGLE).sample(HUGE, 0),
    "endless factor": lambda: decals.scatter(as_surface(TRIANGLE), count=3, factor=1e308),
    "complex colour": lambda: Point((0, 0, 0), radius=1.0, color=np.zeros(3, complex)),  # type: ignore[arg-type]
    "complex radius": lambda: Point((0, 0, 0), radius=1j),  # type: ignore[arg-type]
    "path of a number": lambda: decals.load_scene(1.5),  # type: ignore[arg-type]
    "image of no name": lambda: decals.load_image(""),
    "image of a number": lambda: decals.load_image(1.5),  # type: ignore[arg-type]
    "margin of nothing": lambda: decals.Camera.framing(([0, 0, 0], [1, 1, 1]), margin=0),
    "array as JSON": lambda: blobtree.from_json(np.zeros(3)),  # type: ignore[arg-type]
    "surrogate as JSON": lambda: blobtree.from_json("\ud800"),
    "endless cell": lambda: blobtree.polygonize(BALL, cell_size=1e308),
    "fitting of none": lambda: decals.Camera.fitting(WRONG),
    "small length": lambda: blobtree.ConvolutionSegment((0, 0, 0), (0, 0, 1), radius=1.0, end_radius=5e-324),
    "small period": lambda: blobtree.Gyroid((0, 0, 0), (1, 1, 1), period=5e-324, thickness=0.1),
    "number as tree": lambda: blobtree.numeric_parameters(WRONG),
    "numbers of no tree": lambda: blobtree.numeric_values(WRONG, []),
    "numbers of another tree": lambda: blobtree.numeric_values(
        blobtree.Segment((0, 0, 0), (0, 0, 1), radius=1.0), blobtree.numeric_parameters(BALL)
    ),
    "no list of numbers": lambda: blobtree.with_numeric_values(BALL, WRONG, []),
    "too few numbers": lambda: blobtree.with_numeric_values(BALL, blobtree.numeric_parameters(BALL), [1.0]),
    "gradient by no parameters": lambda: BALL.parameter_gradient([[0, 0, 1]], WRONG),
    "list as attribute": lambda: BALL.attribute([], [[0, 0, 1]]),  # type: ignore[arg-type]
    "large default": lambda: Point((0, 0, 0), radius=1.0, attributes={"a": 1}).attribute(
        "a", [[0, 0, 1]], default=HUGE
    ),
    "number as attributes": lambda: BALL.to_pyvista(resolution=8, attributes=WRONG),
    "rest coordinates": lambda: BALL.to_pyvista(resolution=8, rest_coordinates=np.zeros(3)),  # type: ignore[arg-type]
    "texts as values": lambda: blobtree.fit(BALL, [[0, 0, 1]] * 4, ["x"] * 4),
    "endless weight": lambda: blobtree.fit(
        BALL, [[0, 0, 1]] * 4, normals=[[0, 0, 1]] * 4, normal_weight=HUGE
    ),
    "no evaluation": lambda: blobtree.fit(BALL, [[0, 0, 1]] * 4, max_evaluations=0),
    "number as fixed": lambda: blobtree.fit(BALL, [[0, 0, 1]] * 4, fixed=WRONG),
    "endless samples": lambda: blobtree.from_sdf([[[HUGE] * 2] * 2] * 2, (0, 0, 0), spacing=1.0, width=1.0),
    "tree at no path": lambda: blobtree.save(BALL, WRONG),
    "function of no call": lambda: EditSession(SCENE).do(MapValues([0], "layers", WRONG)),
    "values of no name": lambda: EditSession(SCENE).do(MapValues([0], WRONG, lambda spots: spots.layers)),
    "brush of a number": lambda: EditSession(SCENE).do(
        BrushDecals((0, 0, 1), (0, 0, 1), 0.5, decal_radius=0.1, images=WRONG)
    ),
    "branch of no path": lambda: EditSession(SCENE).do(MoveBranch(0, WRONG, WRONG)),
    "array as texts": lambda: BALL.to_pyvista(resolution=8, attributes=np.array("x")),
    "array as values": lambda: BALL.slice(values=np.array("x")),
    "object as fixed": lambda: blobtree.fit(BALL, [[0, 0, 1]] * 4, fixed=[WRONG]),
    "large sample": lambda: blobtree.from_sdf(np.full((2, 2, 2), 1e308), (0, 0, 0), spacing=1.0, width=1.0),
    "quick move": lambda: EditSession(SCENE).do(MovePrimitive(0, (), (0, 0, 1), quick=WRONG)),
    "endless distance": lambda: decals.Relaxation(MeshSurface(*TRIANGLE), count=3).polish(close=1e308),
    "array as frames": lambda: decals.animate(np.array("x"), "a.gif"),
    "array as attributes": lambda: decals.export(BALL, "a.ply", attributes=np.array("x")),
    "vertex colours": lambda: decals.bake(SCENE, "a.glb", vertex_colors=np.zeros(0)),  # type: ignore[arg-type]
    "array as surfaces": lambda: decals.Relaxation(np.array("x"), count=1),  # type: ignore[arg-type]
    "endless origin": lambda: decals.MeshObject("a", TRIANGLE[0], TRIANGLE[1], origin=HUGE),
    "complex origin": lambda: decals.MeshObject("a", TRIANGLE[0], TRIANGLE[1], origin=np.zeros(3, complex)),
    "device of scattering": lambda: decals.scatter(BALL, spacing=1.0, device="a\0b"),
    "decals of a number": lambda: decals.Decals.concatenate(WRONG),
    "group at no path": lambda: EditSession(SCENE).do(GroupOperands(0, WRONG, (0, 1))),
    "group of no numbers": lambda: EditSession(SCENE).do(GroupOperands(0, (), WRONG)),
    "endless default": lambda: Point((0, 0, 0), radius=1.0, attributes={"wet": 1}).attribute(
        "wet", [[0, 0, 1]], default=1e308
    ),
    "camera of a pose": lambda: decals.pose(SCENE, {}, camera=np.zeros((2, 3))),  # type: ignore[arg-type]
    "rigid": lambda: decals.pose(SCENE, {}, rigid=np.zeros(3)),  # type: ignore[arg-type]
    "name of a law": lambda: decals.define_contact(name=np.zeros(3)),  # type: ignore[arg-type]
    "scale of decals": lambda: EditSession(SCENE).do(ScaleDecals([0], 1e308)),
    "scene of a number": lambda: decals.save_scene(WRONG, "a.json"),
    "recovery of a number": lambda: recovery_path(WRONG),
    "recovery of nothing": lambda: recovery_path(""),
    "boundary": lambda: Creases(MeshSurface(*TRIANGLE), boundary=np.zeros(3)),  # type: ignore[arg-type]
    "fixed": lambda: decals.Relaxation(MeshSurface(*TRIANGLE), count=1).insert([0, 0, 0], fixed=WRONG),
    "layer of no decal": lambda: EditSession(SCENE).do(SetValues.each([], layers="x")),
    "number as source": lambda: decals.MeshObject("a", TRIANGLE[0], TRIANGLE[1], source=3.5),  # type: ignore[arg-type]
    "surrogate as source": lambda: decals.MeshObject("a", TRIANGLE[0], TRIANGLE[1], source="\ud800.ply"),
    "surrogate as name": lambda: decals.TreeObject("\ud800", BALL),
    "NUL in a scene": lambda: decals.load_scene("a\0.json"),
    "surrogate in a scene": lambda: decals.load_scene("\ud800.json"),
    "surrogate in a tree": lambda: blobtree.load("\ud800.json"),
    "surrogate in a mesh": lambda: read_mesh("\ud800.ply"),
    "surrogate in a saved scene": lambda: decals.save_scene(SCENE, "\ud800.json"),
    "surrogate as title": lambda: decals.save_html(SCENE, "a.html", title="\ud800"),
    "surrogate as alternative text": lambda: decals.save_html(SCENE, "a.html", alt="a\udfff"),
    "origin of a saved table": lambda: decals.save_table(SPOTS, "a.csv", origin=[[0, 0, 0]]),  # type: ignore[arg-type]
    "images of a table": lambda: decals.save_table(SPOTS, "a.csv", images=[1e30]),  # type: ignore[list-item]
    "array as picture": lambda: decals.save_figure(SCENE, "a.svg", picture=np.zeros(3)),  # type: ignore[arg-type]
    "endless sampling": lambda: blobtree.check_kind(Point, samples=1e308),  # type: ignore[arg-type]
    "trust in a table": lambda: decals.load_table("a.csv", trust=np.zeros(0)),  # type: ignore[arg-type]
    "origin of a table": lambda: decals.load_table("a.csv", origin=np.array("x")),  # type: ignore[arg-type]
    "no image to cover with": lambda: decals.cover(BALL, count=1, images=[]),
    "no direction": lambda: decals.cover(BALL, count=1, direction=(0, 0, 0)),
    "upward": lambda: decals.cover(BALL, count=1, up=(0, 0, 1)),  # type: ignore[arg-type]
    "sizing": lambda: decals.cover(BALL, count=1, sizing="large"),
    "jacobian": lambda: decals.evaluate(SPOTS, [[0, 0, 1]], [[0, 0, 1]], jacobian=1),  # type: ignore[arg-type]
    "neighbors": lambda: decals.evaluate(SPOTS, [[0, 0, 1]], [[0, 0, 1]], neighbors="no"),  # type: ignore[arg-type]
    "on no object": lambda: decals.evaluate(SPOTS, [[0, 0, 1]], [[0, 0, 1]], on=5),
    "resolution of a mesh": lambda: decals.bake(
        decals.Scene(objects=(decals.MeshObject("a", *TRIANGLE),), camera=CAMERA), "a.glb", resolution=0
    ),
    "number as contact": lambda: decals.render(SCENE, contact=1),  # type: ignore[arg-type]
    "truth as mapping": lambda: decals.render(SCENE, mapping=True),  # type: ignore[arg-type]
    "comma as receivers": lambda: SPOTS.replace(receivers=","),
    "empty receiver": lambda: SPOTS.replace(receivers="hull,, lid"),
    "empty label": lambda: decals.TreeObject("a", BALL, labels=("",)),
    "truths as radii": lambda: SPOTS.replace(radii=[True] * 3),
    "truth as opacity": lambda: SPOTS.replace(opacities=True),
    "truth as field of view": lambda: decals.Camera((0, 0, 4), (0, 0, 0), fov=True),
    "truth as radius": lambda: Point((0, 0, 0), radius=True),
    "text as radius": lambda: Point((0, 0, 0), radius="1"),  # type: ignore[arg-type]
    "text as centre": lambda: Point("123", radius=1.0),  # type: ignore[arg-type]
    "truths as colour": lambda: Point((0, 0, 0), radius=1.0, color=(True, True, True)),
    "truths as points": lambda: BALL([[True] * 3]),
    "truth as resolution": lambda: blobtree.polygonize(BALL, resolution=True),
    "truth as cell size": lambda: blobtree.polygonize(BALL, cell_size=True),
    "empty mask": lambda: decals.scatter(BALL, count=3, mask=lambda points: np.zeros(len(points), bool)),
    "scene as text": lambda: decals.save_scene(SCENE, "a.txt"),
    "NUL in a saved scene": lambda: decals.save_scene(SCENE, "a\0/a.json"),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=list(CALLS))
def test_a_wrong_argument_gets_an_error_of_ours(call: Callable[[], object]) -> None:
    with pytest.raises(ImplicitDecalsError):
        call()


def test_iteration_over_decals_ends_at_the_last() -> None:
    """Python ends a loop over an object without `__iter__` at the first IndexError."""
    assert [len(spot) for spot in SPOTS] == [1, 1, 1]  # type: ignore[attr-defined]
    with pytest.raises(IndexError):
        SPOTS[3]


HEADER = "ply\nformat ascii 1.0\n"
POINTS = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\n"
ROWS = "0 0 0\n1 0 0\n0 1 0\n"

PLY = {
    "property without element": f"{HEADER}property float x\nend_header\n",
    "negative rows": f"{HEADER}{POINTS.replace('3', '-3')}{FACES}end_header\n{ROWS}3 0 1 2\n",
    "endless rows": f"{HEADER}{POINTS.replace('3', '9' * 30)}{FACES}end_header\n{ROWS}3 0 1 2\n",
    "property twice": f"{HEADER}{POINTS}property float x\n{FACES}end_header\n{ROWS}3 0 1 2\n",
    "lists as coordinates": f"{HEADER}{POINTS.replace('float x', 'list uchar float x')}{FACES}end_header\n"
    "1 0 0 0\n2 0 0 0 0\n1 0 0 0\n3 0 1 2\n",
    "numbers as faces": f"{HEADER}{POINTS}{FACES.replace('list uchar int', 'int')}end_header\n{ROWS}3\n",
    "numbers as strips": f"{HEADER}{POINTS}element tristrips 1\nproperty int vertex_indices\n"
    f"end_header\n{ROWS}3\n",
    "endless list": f"{HEADER}{POINTS}{FACES.replace('uchar', 'float')}end_header\n{ROWS}inf 0 1 2\n",
    "NaN as length": f"{HEADER}{POINTS}{FACES.replace('uchar', 'float')}end_header\n{ROWS}nan 0 1 2\n",
    "NaN as corner": f"{HEADER}{POINTS}{FACES}end_header\n{ROWS}3 0 nan 1e300\n",
    "edges as faces": f"{HEADER}{POINTS}{FACES}end_header\n{ROWS}2 0 1\n",
    "no properties": f"{HEADER}element vertex 3\nelement face 1\nend_header\n{ROWS}",
    "unknown format": "ply\nformat octal 1.0\nend_header\n",
    "coordinate beyond float32": f"{HEADER}{POINTS}{FACES}end_header\n1e300 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
}


@pytest.mark.parametrize("text", PLY.values(), ids=list(PLY))
def test_an_odd_ply_header_gets_an_error_of_ours(text: str, tmp_path: Path) -> None:
    path = tmp_path / "odd.ply"
    path.write_text(text, encoding="ascii")
    with pytest.raises(ImplicitDecalsError):
        decals.load_model(path)


@pytest.mark.parametrize("start", ["", '{"format": "implicit-decals-scene", "version": 1, "objects": '])
@pytest.mark.parametrize(
    "load", [decals.load_model, decals.load_scene, blobtree.load], ids=lambda f: f.__name__
)
def test_deeply_nested_json_gets_an_error_of_ours(load: Any, start: str, tmp_path: Path) -> None:
    path = tmp_path / "deep.json"
    path.write_text(start + "[" * 100_000, encoding="ascii")
    with pytest.raises(ImplicitDecalsError):
        load(path)


def test_a_source_may_be_a_path_object() -> None:
    assert decals.MeshObject("a", TRIANGLE[0], TRIANGLE[1], source=Path("a.ply")).source == "a.ply"  # type: ignore[arg-type]
    assert np.isfinite(decals.MeshObject("a", TRIANGLE[0], TRIANGLE[1]).vertices).all()
