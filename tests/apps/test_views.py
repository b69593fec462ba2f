import math

import numpy as np
import pytest

from blobtree import Point
from decals import MeshObject, TreeObject
from decals.apps.models.shapes import torus_knot
from decals.apps.views import View, frame, parse_view
from decals.errors import InvalidInput
from decals.scenes.camera import PRESETS, UPRIGHT
from decals.scenes.objects import SceneObject


def _knot(scale: float = 1.0, shift: float = 0.0) -> MeshObject:
    vertices, faces = torus_knot(along=60, around=8)
    return MeshObject("knot", vertices * np.float32(scale) + np.float32(shift), faces)


def _ball() -> TreeObject:
    return TreeObject("ball", Point((3.0, 1.0, 0.0), radius=0.5))


@pytest.mark.parametrize("size", [(400, 300), (300, 400), (1000, 50)])
@pytest.mark.parametrize("text", ["three-quarter", "top", "back", "1,2,-3", "0,5,0"])
@pytest.mark.parametrize("objects", [(_knot(),), (_knot(1e-3, 5.0),), (_knot(1e4), _ball())])
def test_objects_fill_the_picture(objects: tuple[SceneObject, ...], text: str, size: tuple[int, int]) -> None:
    camera = frame(objects, parse_view(text, UPRIGHT["y"]), size)
    mesh = objects[0]
    assert isinstance(mesh, MeshObject)
    x, y, z = camera.axes @ (mesh.vertices.astype(np.float64) - camera.position).T
    half = math.tan(math.radians(camera.fov) / 2)
    across, above = np.abs(x / -z) / (half * size[0] / size[1]), np.abs(y / -z) / half
    assert max(across.max(), above.max()) == pytest.approx(1 / 1.08, abs=2e-3)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_presets_follow_the_upward_axis(up: str) -> None:
    axes = UPRIGHT[up]
    views = {name: parse_view(name, axes) for name in PRESETS}
    assert all(view.up == axes.up for view in views.values())
    assert np.array_equal(views["top"].direction, axes.up)
    assert np.array_equal(views["front"].direction, axes.front)
    assert np.array_equal(views["right"].direction, np.cross(axes.up, axes.front))
    for one, other in (("left", "right"), ("top", "bottom"), ("front", "back")):
        assert np.allclose(np.add(views[one].direction, views[other].direction), 0.0)


def test_directions_are_parsed() -> None:
    assert parse_view("1,-2.5,3e1", UPRIGHT["z"]) == View((1.0, -2.5, 30.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize("text", ["", "up", "1,2", "1,2,3,4", "0,0,0", "1,nan,0", "inf,0,0"])
def test_invalid_cameras_are_refused(text: str) -> None:
    if text == "":
        assert parse_view(text, UPRIGHT["y"]) == parse_view("three-quarter", UPRIGHT["y"])
        return
    with pytest.raises(InvalidInput, match="--camera"):
        parse_view(text, UPRIGHT["y"])
