"""`measure` against closed forms: disks on a plane, one decal on a ball, folds of dense sets."""

import json
import math
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Point
from decals import measure
from decals.errors import InvalidScene
from decals.surfaces import MeshSurface
from tests.decals.distortion import random_points
from tests.decals.fault_models import FAULT_MODELS
from tests.decals.meshes import box, icosphere, plane, sphere

SQUARE = [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]
DISTANCE = 1.2


def flat_scene(positions: Any, radii: Any, **columns: Any) -> decals.Scene:
    count = len(positions)
    rows = decals.Decals(positions, [[0, 0, 1]] * count, [[1, 0, 0]] * count, radii, **columns)
    square = decals.MeshObject("square", SQUARE, [[0, 1, 2], [0, 2, 3]])
    return decals.Scene(objects=[square], camera=decals.Camera((0, 0, 5)), decals=rows, images=["eye"])


@pytest.mark.parametrize("contact", ["product", "min", "radial", "elastic"])
def test_two_decals_on_a_plane(contact: str) -> None:
    found = measure(flat_scene([[-DISTANCE / 2, 0, 0], [DISTANCE / 2, 0, 0]], 1.0), contact=contact)
    half = DISTANCE / 2
    lens = 2 * math.acos(half) - DISTANCE * math.sqrt(1 - half**2)
    union = 2 * math.pi - lens
    assert found.area == pytest.approx(16)
    assert repr(found).startswith("Measures(area=16, coverage=0.3")
    assert repr(found).endswith(f", samples={found.samples}, decals=DecalMeasures(2))")
    assert found.coverage == pytest.approx(union / 16, rel=0.01)
    assert found.gap_area == pytest.approx(16 - union, rel=0.01)
    assert found.overlap_area == pytest.approx(lens, rel=0.02)
    assert found.contact_length == pytest.approx(2 * math.sqrt(1 - half**2), rel=0.05)
    np.testing.assert_allclose(found.decals.visible_area, union / 2, rtol=0.01)
    np.testing.assert_allclose(found.decals.overlap_area, lens, rtol=0.02)
    np.testing.assert_allclose(found.decals.contact_length, 2 * math.sqrt(1 - half**2), rtol=0.1)
    np.testing.assert_allclose(found.decals.nearest, DISTANCE, rtol=1e-6)
    assert found.rho == pytest.approx(DISTANCE / math.sqrt(16 / math.sqrt(3)), rel=1e-5)
    assert found.folded == 0
    assert found.stretch_median == pytest.approx(1, abs=0.3)
    assert found.stretch_max > 1.5
    assert 0 <= found.stretched < 0.05
    assert (found.stretched > 0) == (found.stretch_max > 5)


def test_layers_hide_and_do_not_touch() -> None:
    found = flat_scene([[0, 0, 0], [0, 0, 0]], [1.0, 0.5], layers=[0, 1]).measure(contact="product")
    np.testing.assert_allclose(found.decals.visible_area, [0.75 * math.pi, 0.25 * math.pi], rtol=0.02)
    assert found.overlap_area == pytest.approx(0.25 * math.pi, rel=0.02)
    assert found.contact_length == 0
    assert found.stretch_max == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("mapping", ["corrected", "chord"])
@pytest.mark.parametrize("mesh", [False, True])
def test_one_decal_on_a_ball(mapping: str, mesh: bool) -> None:
    radius = 0.8
    model: Any = Point((0, 0, 0), radius=1.0)
    item = decals.MeshObject("ball", *icosphere(4)) if mesh else decals.TreeObject("ball", model)
    disk = decals.Decals([[0, 0, 1]], [[0, 0, 1]], [[1, 0, 0]], [radius])
    scene = decals.Scene(objects=[item], camera=decals.Camera((0, 0, 5)), decals=disk, images=["eye"])
    found = measure(scene, mapping=mapping, contact="product")
    angle = radius if mapping == "corrected" else 2 * math.asin(radius / 2)
    stretch = angle / math.sin(angle) if mapping == "corrected" else 1 / math.cos(angle / 2) ** 2
    assert found.area == pytest.approx(4 * math.pi, rel=0.01)
    assert found.decals.visible_area[0] == pytest.approx(2 * math.pi * (1 - math.cos(angle)), rel=0.02)
    assert found.stretch_max == pytest.approx(stretch, rel=0.02)
    assert (found.folded, found.contact_length, found.overlap_area) == (0, 0, 0)


def test_dense_sets_fold_in_product_and_not_in_elastic_contact() -> None:
    rng = np.random.default_rng(2)
    positions = rng.uniform(-2, 2, (60, 3)) * [1, 1, 0]
    scene = flat_scene(positions, 10 ** rng.uniform(-1, 0, 60))
    assert 0.002 < measure(scene, contact="product").folded < 0.1
    elastic = measure(scene, contact="elastic")
    assert elastic.folded == 0
    assert np.nansum(elastic.decals.folded) == 0


def test_numbers_are_reproducible_and_become_json() -> None:
    scene = flat_scene([[0, 0, 0], [9, 9, 9]], [1.0, 0.5])
    one, other = (measure(scene, samples=500, seed=3) for _ in range(2))
    assert one.to_dict() == other.to_dict()
    assert json.loads(json.dumps(one.to_dict()))["decals"]["stretch_max"][1] is None
    bare = measure(scene.replace(decals=decals.Decals.empty()), samples=100)
    assert bare.coverage == 0
    assert bare.gap_area == pytest.approx(16)
    assert math.isnan(bare.stretch_max)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"scene": 5}, "scene: expected a Scene, got 5"),
        ({"samples": 0}, "samples: expected a whole number from 1"),
        ({"seed": -1}, "seed: expected"),
        ({"contact": "round"}, "contact: expected one of"),
        (
            {"scene": decals.Scene(objects=[], camera=decals.Camera((0, 0, 5)))},
            "expected a scene with an object",
        ),
    ],
)
def test_refuses(wrong: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidScene, match=says):
        measure(**{"scene": flat_scene([[0, 0, 0]], 1.0)} | wrong)


def item(name: str, surface: MeshSurface) -> decals.MeshObject:
    return decals.MeshObject(name, surface.vertices, surface.faces)


@pytest.mark.ordinary_cases("box on a floor")
@pytest.mark.parametrize(
    "objects",
    [
        (item("floor", plane(4.0)), item("box", box((1.4, 1.0, 1.0), (0.0, 0.0, 0.5)))),
        (item("wall", box((3.0, 3.0, 0.4))), item("ball", sphere(0.8, (0.1, 0.2, 0.35), 3))),
        (item("ball", sphere(0.8, level=3)), item("other", sphere(0.8, (0.9, 0.0, 0.2), 3))),
    ],
    ids=["box on a floor", "ball in a wall", "two balls"],
)
def test_no_decal_is_a_sliver_where_objects_meet(
    objects: tuple[decals.MeshObject, decals.MeshObject],
) -> None:
    layout = decals.scatter(objects, count=80, seed=1)
    camera = decals.Camera.fitting(objects[0].vertices)
    scene = decals.Scene(objects=objects, camera=camera, decals=layout, images=["tile"])
    measures = measure(scene, samples=20_000)
    shares = measures.decals.visible_area / (np.pi * layout.radii.astype(np.float64) ** 2)
    assert shares.min() > 0.15
    assert measures.coverage > 0.9999


def test_ragged_borders_are_covered() -> None:
    """A bowl that has lost random triangles near its rim."""
    for seed in (1, 2):
        vertices, faces = FAULT_MODELS["bowl"]()
        near_rim = vertices[faces].mean(axis=1)[:, 2] > 0.05
        lost = near_rim & (np.random.default_rng(seed).random(len(faces)) < 0.4)
        mesh = vertices, faces[~lost]
        layout = decals.scatter(MeshSurface(*mesh), count=100, seed=seed)
        points, normals = random_points(mesh, 50_000, seed)
        found = decals.evaluate(layout, points, normals)
        assert ((found.owner >= 0) & (((found.uv - 0.5) ** 2).sum(axis=1) <= 0.2501)).all()
        assert layout.radii.max() < 1.6 * np.median(layout.radii)
