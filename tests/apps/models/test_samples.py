import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from numpy.typing import NDArray

from blobtree import polygonize
from decals import MeshObject, TreeObject, measure
from decals.apps.commands.demo import nest_scene, tile_scene
from decals.apps.gallery import spanning
from decals.apps.models.samples import SAMPLES, axes_of, sample, sample_mesh
from decals.apps.models.shapes import egg, rounded_box, torus_knot
from decals.errors import InvalidInput
from decals.surfaces.triangulate import MeshArrays


def _volume(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> float:
    a, b, c = vertices[faces].transpose(1, 0, 2).astype(np.float64)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize(
    "make",
    [
        torus_knot,
        lambda: torus_knot(turns=3, windings=5, along=200, around=16, tube=0.1),
        lambda: egg((1, 2, 3), radius=0.5, height=0.7),
        lambda: rounded_box((0, 0, 0), half=(1, 2, 3), rounding=0.3),
    ],
)
def test_meshes_are_closed_and_wound_outward(make: Callable[[], MeshArrays]) -> None:
    vertices, faces = make()
    assert vertices.dtype == np.float32
    assert faces.dtype == np.int32
    points: NDArray[Any] = vertices
    corners: NDArray[Any] = faces
    assert pv.PolyData.from_regular_faces(points, corners).is_manifold
    assert _volume(vertices, faces) > 0


def test_the_knot_has_its_tube_everywhere() -> None:
    vertices, _ = torus_knot(along=300, around=20, tube=0.2)
    rings = vertices.reshape(300, 20, 3)
    distances = np.linalg.norm(rings - rings.mean(axis=1, keepdims=True), axis=2)
    assert np.allclose(distances, 0.2, atol=1e-5)


def test_sizes_are_those_of_the_arguments() -> None:
    vertices, _ = rounded_box((1, 0, 0), half=(1, 2, 3), rounding=0.5)
    assert np.allclose(vertices.min(axis=0), [0, -2, -3], atol=0.01)
    assert np.allclose(vertices.max(axis=0), [2, 2, 3], atol=0.01)
    out = np.abs(vertices - [1, 0, 0]) - [0.5, 1.5, 2.5]  # beyond the box of which this is the offset
    assert np.allclose(np.linalg.norm(np.maximum(out, 0), axis=1), 0.5, atol=1e-5)
    vertices, _ = egg((0, 5, 0), radius=0.5, height=0.7)
    assert np.allclose([vertices[:, 1].min(), vertices[:, 1].max()], [4.3, 5.7], atol=1e-3)


def test_all_samples_are_listed_and_generated_ones_need_no_network() -> None:
    assert SAMPLES == ("creature", "dragon", "horse", "knot", "spheres")
    for name in ("creature", "spheres"):
        made = sample(name)
        assert isinstance(made, TreeObject)
        assert len(polygonize(made.tree, resolution=24).faces) > 100
    knot = sample("knot")
    assert isinstance(knot, MeshObject)
    assert knot.source == "sample:knot"
    assert np.array_equal(knot.vertices, sample_mesh("knot")[0])


def test_the_parts_of_the_creature_have_names() -> None:
    made = sample("creature")
    assert isinstance(made, TreeObject)
    parts = dict(zip(made.names.values(), made.tree.children, strict=True))
    assert list(made.names) == [(place,) for place in range(len(parts))]
    middles = {name: np.mean(part.bounds, axis=0) for name, part in parts.items()}
    for name, right in middles.items():
        if name.startswith("right "):
            left = middles[name.replace("right", "left")]
            np.testing.assert_allclose(left, right * [1, 1, -1], atol=1e-6)
            assert right[2] > 0  # the creature looks along x, and y points upward
    assert middles["head"][1] > middles["chest"][1] > middles["right foot"][1]
    assert middles["muzzle"][0] > middles["hips"][0] > middles["tail 1"][0]


def test_an_unknown_sample_mesh_is_refused() -> None:
    with pytest.raises(InvalidInput, match="dragon, horse, knot"):
        sample_mesh("spheres")


def test_all_models_except_the_horse_stand_along_y() -> None:
    assert axes_of("bunny.ply").up == (0.0, 1.0, 0.0)
    assert axes_of("horse").up == (0.0, 0.0, 1.0)


@pytest.mark.slow
def test_decals_run_across_creature_and_egg(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("decals.apps.commands.demo.COUNT", 300)
    scene = nest_scene(progress=lambda _stage, _fraction: None)
    creature, shell = (item.surface for item in scene.objects)
    distance = [
        np.linalg.norm(surface.project(scene.decals.positions)[0] - scene.decals.positions, axis=1)
        for surface in (creature, shell)
    ]
    radii = scene.decals.radii
    crossing = (np.maximum(*distance) < 0.8 * radii) & (np.minimum(*distance) < 1e-3)
    assert crossing.sum() >= 3
    assert measure(scene).coverage > 0.9995  # scales end at the eyes
    tiles = tile_scene(scene)
    assert np.array_equal(tiles.decals.positions, scene.decals.positions)
    assert set(tiles.decals.images.tolist()) == set(range(len(tiles.images)))


def test_one_decal_spans_both_surfaces() -> None:
    scene = spanning.scene(fov=27.0)
    assert len(scene.decals) == 1
    center, radius = scene.decals.positions[0], scene.decals.radii[0]
    rim = center + radius * np.array([[-0.9, 0, 0], [0.9, 0, 0]], np.float32)
    box, blob = (item.surface for item in scene.objects)
    assert np.linalg.norm(box.project(rim[:1])[0] - rim[:1]) < 0.1 * radius
    assert np.linalg.norm(blob.project(rim[1:])[0] - rim[1:]) < 0.5 * radius


def test_a_wrong_data_folder_is_ignored_without_downloads(tmp_path: Path) -> None:
    program = "from decals.apps.models.samples import sample; sample('knot')"
    environment = {**os.environ, "PYVISTA_DATA": str(tmp_path / "missing")}
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "PYVISTA_DATA" not in result.stderr
