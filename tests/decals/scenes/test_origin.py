"""Models far from the zero point: scenes keep them relative to a local origin, and look the same."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import blobtree
import decals
from decals.editing import EditSession
from decals.errors import InvalidScene
from decals.scenes.script import write_script
from tests.decals.baking.glb import need, read_json
from tests.decals.meshes import icosphere

Place = tuple[float, float, float]

PLACES: list[Place] = [(1e6, -2e6, 0.0), (1e9, 0.0, 4e8), (0.0, 0.0, 1e12)]

TREE = blobtree.Point((-0.2, 0, 0), radius=0.75) + blobtree.Segment((0.5, 0, 0), (0.5, 0.5, 0), radius=0.25)


def mesh(place: Place) -> tuple[np.ndarray, np.ndarray]:
    """A ball whose vertices float64 represents exactly at all places."""
    vertices, faces = icosphere(2)
    return np.round(512 * vertices) / 512 + np.array(place), faces


@cache
def near_scene(kind: str) -> decals.Scene:
    return (
        decals.cover(mesh((0.0, 0.0, 0.0)), count=12, seed=2)
        if kind == "mesh"
        else decals.cover(TREE, count=12)
    )


@cache
def near_pixels(kind: str) -> np.ndarray:
    return pixels(near_scene(kind))


def pixels(scene: decals.Scene) -> np.ndarray:
    return np.asarray(scene.render(size=(80, 60), samples=1).pixels)


@pytest.mark.slow_cases("place1", "place2")
@pytest.mark.parametrize("place", PLACES)
def test_a_far_mesh_looks_as_a_near_one(place: Place) -> None:
    near, far = near_scene("mesh"), decals.cover(mesh(place), count=12, seed=2)
    assert far.origin == place
    np.testing.assert_array_equal(far.decals.positions, near.decals.positions)
    np.testing.assert_array_equal(far.bounds, near.bounds)
    np.testing.assert_array_equal(pixels(far), near_pixels("mesh"))
    seen = decals.evaluate(far.decals, far.decals.positions, far.decals.normals)
    assert seen.owner.tolist() == list(range(12))
    (item,) = far.objects
    assert item.surface.raycast([[0, 0, 5]], [[0, 0, -1]])[0] == pytest.approx(4.0, abs=0.05)


@pytest.mark.slow_cases("place1", "place2")
@pytest.mark.parametrize("place", PLACES)
def test_a_far_tree_is_the_near_one(place: Place) -> None:
    points = np.random.default_rng(1).uniform(-1, 1, (200, 3))
    for tree in (TREE.translate(place), blobtree.Point(place, radius=1.0)):
        item = decals.TreeObject("tree", tree)
        near = TREE if tree != blobtree.Point(place, radius=1.0) else blobtree.Point((0, 0, 0), radius=1.0)
        assert item.origin == place
        np.testing.assert_allclose(item.tree(points), near(points), atol=1e-6)
    far = decals.cover(TREE.translate(place), count=12)
    np.testing.assert_array_equal(pixels(far), near_pixels("tree"))


def test_files_scripts_and_sessions_keep_the_origin(tmp_path: Path) -> None:
    place = PLACES[1]
    scene = decals.cover(mesh(place), TREE.translate(np.add(place, (3, 0, 0))), count=20)
    assert {item.origin for item in scene.objects} == {place}
    scene.save(tmp_path / "far.json")
    loaded = decals.load_scene(tmp_path / "far.json")
    edited = EditSession(scene).document.scene
    write_script(scene, tmp_path / "far.py")
    assert "origin=(1000000000.0, 0.0, 400000000.0)" in (tmp_path / "far.py").read_text()
    for other in (loaded, edited):
        assert other.origin == place
        np.testing.assert_array_equal(pixels(other), pixels(scene))


def test_baked_nodes_are_translated(tmp_path: Path) -> None:
    need("trimesh")
    place = PLACES[0]
    decals.bake(decals.cover(mesh(place), count=3), tmp_path / "far.glb", vertex_colors=True)
    matrices = [node["matrix"] for node in read_json(tmp_path / "far.glb")["nodes"] if "matrix" in node]
    assert matrices == [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *place, 1]]


def test_plotters_show_far_scenes_at_their_place() -> None:
    pictures = []
    for place in ((0.0, 0.0, 0.0), PLACES[0]):
        plotter = pv.Plotter(off_screen=True, window_size=[80, 60])
        plotter.decals.add_scene(decals.cover(mesh(place), count=12), camera=True)
        marker = pv.Sphere(radius=0.3)
        plotter.add_mesh(marker.points_to_double().translate(np.add(place, (1.2, 0, 0.5)), inplace=False))
        plotter.camera.clipping_range = (1.0, 20.0)
        pictures.append(np.asarray(plotter.screenshot(None, return_img=True)).astype(int))
        plotter.close()
    different = np.abs(pictures[0] - pictures[1]).max(axis=-1) > 8
    assert different.mean() < 0.02  # VTK's own marker is rounded
    assert pictures[0].std() > 10


def test_objects_too_far_apart_are_refused() -> None:
    with pytest.raises(InvalidScene, match="object 'model 2': expected a distance of at most 100000 times"):
        decals.cover(mesh((0.0, 0.0, 0.0)), mesh(PLACES[1]), count=4)


def test_a_camera_in_the_coordinates_of_a_far_model_is_refused() -> None:
    camera = decals.Camera((1e6, -2e6, 5.0), target=(1e6, -2e6, 0.0))
    with pytest.raises(InvalidScene, match="camera: expected one relative to the scene's origin"):
        decals.Scene(objects=[mesh(PLACES[0])], camera=camera)
