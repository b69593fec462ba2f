"""Models to a scene in one call."""

import numpy as np
import pytest

import decals
from blobtree import Point
from decals.errors import InvalidInput
from tests.decals.meshes import sphere

BALL = Point((0, 0, 0), radius=1.0)


def test_decals_over_a_tree_and_a_mesh() -> None:
    surface = sphere(center=(1.6, 0.0, 0.0))
    mesh = decals.MeshObject("ball", surface.vertices, surface.faces)
    scene = decals.cover(BALL, mesh, count=60, images=["scale", "rock"], seed=4)
    assert len(scene.decals) == 60
    assert [item.name for item in scene.objects] == ["model 1", "ball"]
    assert [image.source for image in scene.images] == ["scale", "rock"]
    assert set(scene.decals.images.tolist()) == {0, 1}
    on_tree = np.abs(BALL(scene.decals.positions) - 0.5) < 1e-3
    assert 10 < on_tree.sum() < 50


def test_the_seed_and_the_direction_decide() -> None:
    first, again, other = (decals.cover(BALL, count=30, seed=seed).decals for seed in (1, 1, 2))
    assert first.packed().tobytes() == again.packed().tobytes()
    assert first.packed().tobytes() != other.packed().tobytes()
    along = decals.cover(BALL, count=30, direction=(0, 0, 1)).decals
    assert (along.tangents[:, 2] >= -1e-6).all()


def test_the_whole_model_is_in_the_picture() -> None:
    scene = decals.cover(BALL, count=0, view_direction=(1, 0, 0))
    points = scene.objects[0].surface.sample(500, seed=9)[0]
    near, far = scene.camera.clip_range(scene.bounds)
    project = scene.camera.projection(4 / 3, near, far) @ scene.camera.view()
    clip = np.column_stack([points, np.ones(len(points))]) @ project.T
    assert (np.abs(clip[:, :2]) <= clip[:, 3:]).all()
    assert np.abs(clip[:, 1] / clip[:, 3]).max() > 0.8
    assert scene.camera.position[0] > 1.0


@pytest.mark.parametrize("models", [(), ("horse",), (None,)])
def test_what_is_no_model_is_refused(models: tuple[object, ...]) -> None:
    with pytest.raises(InvalidInput, match="expected"):
        decals.cover(*models)  # type: ignore[arg-type]


def test_the_picture_shows_raised_decals_whole() -> None:
    dome = np.hypot(*np.mgrid[-1:1:32j, -1:1:32j]) < 0.7
    stud = decals.DecalMaterial("stud", np.ones((32, 32, 3)), height=1.0 * dome, relief=0.9)
    scene = decals.cover(BALL, count=12, images=stud)
    moved = decals.displace(scene, edge_length=0.1, resolution=16)
    points = np.asarray(moved.to_polydata().points, float)
    matrix = scene.camera.clip_matrix((400, 300), BALL.bounds)
    clip = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    assert np.abs(clip[:, :2] / clip[:, 3:]).max() < 1.0
    flat = decals.cover(BALL, count=12)
    assert np.linalg.norm(flat.camera.position) < np.linalg.norm(scene.camera.position)
