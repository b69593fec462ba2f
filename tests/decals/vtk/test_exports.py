"""pyvista's own exports: objects and decals are baked into them, and those that cannot say so."""

import base64
import io
import json
import re
import sys
import warnings
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from decals import Decals, Scene
from decals.baking import box_atlas
from decals.vtk import exports
from tests.decals.baking.glb import Array, ball_and_cube, bilinear, expected_colors, linear, need
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import both, shot

SIZE = 256


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small textures."""
    monkeypatch.setattr(exports, "TEXTURE_SIZE", SIZE)
    monkeypatch.setattr(exports, "TEXTURE_SAMPLES", 1)


def shown(plotter: Factory, scene: Scene) -> Plotter:
    """A plotter with a scene and an actor of VTK."""
    pl = plotter()
    pl.add_mesh(pv.Sphere(radius=0.2, center=(0, 0, -3)), name="own")
    pl.decals.add_scene(scene, camera=True)
    shot(pl)
    return pl


def colors_are_right(points: Array, normals: Array, uv: Array, texture: Array, scene: Scene) -> bool:
    """Return True if the texture has the colours of the decals by the oracle in most of some points."""
    assert texture.shape == (SIZE, SIZE, 3)
    got = bilinear(linear(texture / 255), uv)
    ball = np.linalg.norm(points, axis=1) < 1.001
    assert 0.2 < ball.mean() < 1.0
    want = np.empty_like(got)
    for rows, item in ((ball, scene.objects[0]), (~ball, scene.objects[1])):
        want[rows] = expected_colors(scene, item.color, points[rows], normals[rows])  # type: ignore[union-attr]
    off = np.abs(got - want).max(axis=1)
    return bool(np.median(off) < 0.02 and np.std(want, axis=0).min() > 0.02)


def by_gltf(pl: Plotter, folder: Path) -> tuple[Array, Array, Array, Array]:
    """Points, normals, coordinates and texture of the decals' mesh in a glTF file, read without a library."""
    pl.export_gltf(str(folder / "a.gltf"))
    tree = json.loads((folder / "a.gltf").read_text())
    buffers = [base64.b64decode(buffer["uri"].partition(",")[2]) for buffer in tree["buffers"]]

    def array(number: int) -> Array:
        accessor = tree["accessors"][number]
        view = tree["bufferViews"][accessor["bufferView"]]
        count = accessor["count"] * {"VEC2": 2, "VEC3": 3}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        flat = np.frombuffer(buffers[view["buffer"]], "<f4", count, start)
        return flat.reshape(accessor["count"], -1).astype(float)

    attributes = [mesh["primitives"][0]["attributes"] for mesh in tree["meshes"]]
    (baked,) = (names for names in attributes if "TEXCOORD_0" in names)
    assert len(attributes) == 2
    (image,) = tree["images"]
    view = tree["bufferViews"][image["bufferView"]] if "bufferView" in image else None
    content = (
        base64.b64decode(image["uri"].partition(",")[2])
        if view is None
        else buffers[view["buffer"]][view["byteOffset"] :][: view["byteLength"]]
    )
    texture = np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))
    uv = array(baked["TEXCOORD_0"])
    uv[:, 1] = 1.0 - uv[:, 1]  # glTF counts rows from the top
    return array(baked["POSITION"]), array(baked["NORMAL"]), uv, texture


def by_obj(pl: Plotter, folder: Path) -> tuple[Array, Array, Array, Array]:
    """The same of an OBJ file."""
    pl.export_obj(folder / "a.obj")
    text = (folder / "a.obj").read_text()
    rows = {
        key: np.array([line.split()[1:] for line in text.splitlines() if line.startswith(f"{key} ")], float)
        for key in ("v", "vn", "vt")
    }
    (name,) = re.findall(r"map_Kd (\S+)", (folder / "a.mtl").read_text())
    texture = np.asarray(Image.open(folder / name).convert("RGB"))
    count = len(rows["vt"])
    assert len(rows["v"]) > count  # the actor of VTK has no coordinates
    own = slice(len(rows["v"]) - count, None)
    return rows["v"][own], rows["vn"][own], rows["vt"], texture


@pytest.mark.slow
@pytest.mark.parametrize("export", [by_gltf, by_obj], ids=["gltf", "obj"])
def test_files_have_the_colours_of_the_decals(
    plotter: Factory, tmp_path: Path, export: Callable[[Plotter, Path], tuple[Array, Array, Array, Array]]
) -> None:
    need("xatlas")
    scene = ball_and_cube(count=20)
    pl = shown(plotter, scene)
    before = shot(pl)
    points, normals, uv, texture = export(pl, tmp_path)
    inside = np.abs(points).max(axis=1) < 2.9
    assert colors_are_right(points[inside], normals[inside], uv[inside], texture, scene)
    np.testing.assert_array_equal(shot(pl), before)
    assert set(pl.renderer.actors) >= {"own", "plotter.decals"}
    assert not [name for name in pl.renderer.actors if name.startswith(exports.BAKED)]


@pytest.mark.slow
def test_html_files_hold_the_texture(plotter: Factory, tmp_path: Path) -> None:
    need("xatlas")
    pytest.importorskip("trame_vtk", reason="trame-vtk is not installed; it is in the extra `browser`")
    pl = shown(plotter, ball_and_cube(count=6))
    with pytest.warns(pv.core.errors.PyVistaDeprecationWarning):  # it points to plotter.trame
        pl.export_html(tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text()
    packed = max(re.findall(r"[A-Za-z0-9+/=]{1000,}", text), key=len)
    archive = zipfile.ZipFile(io.BytesIO(base64.b64decode(packed)))
    scene = json.loads(archive.read("index.json"))
    assert "Texture" in json.dumps(scene)
    longest = max(len(archive.read(name)) for name in archive.namelist())
    assert longest >= 3 * SIZE * SIZE  # the texels


def test_without_xatlas_colours_are_at_the_vertices(
    plotter: Factory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a surface that is too rugged for a box atlas."""
    monkeypatch.setattr(box_atlas, "MAX_CHARTS", 0)
    monkeypatch.setitem(sys.modules, "xatlas", None)
    pl = shown(plotter, ball_and_cube(count=6))
    with pytest.warns(UserWarning, match=r"export_gltf writes .* colours of vertices: .*pip install") as said:
        pl.export_gltf(str(tmp_path / "a.gltf"))
    assert [item.filename for item in said] == [__file__]
    tree = json.loads((tmp_path / "a.gltf").read_text())
    names = [set(mesh["primitives"][0]["attributes"]) for mesh in tree["meshes"]]
    assert sum("COLOR_0" in one for one in names) == 1


@pytest.mark.parametrize("name", [pytest.param("export_vtksz", marks=pytest.mark.slow), "export_vrml"])
def test_other_exports_name_bake(plotter: Factory, tmp_path: Path, name: str) -> None:
    pl = plotter(shape=(1, 2))
    pl.decals.add_scene(both(), camera=True)
    pl.subplot(0, 1)
    pl.decals.add_scene(both(), camera=True)
    shot(pl)
    with warnings.catch_warnings(record=True) as said, suppress(ImportError, AttributeError):
        warnings.simplefilter("always")
        getattr(pl, name)(tmp_path / "a.file")  # pyvista needs a package for one that may not be here
    texts = [str(item.message) for item in said if "own actors" in str(item.message)]
    assert len(texts) == 1
    assert f"{name} writes VTK's own actors; " in texts[0]
    assert "decals.bake(plotter.decals.scene" in texts[0]
    pl.close()
    assert name not in pl.__dict__


def test_an_export_before_the_first_frame_only_warns(
    plotter: Factory, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pl = plotter()
    pl.add_mesh(pv.Sphere(radius=0.2, center=(0, 0, -3)))
    pl.decals.add_scene(both(), camera=True)
    with pytest.warns(UserWarning, match="own actors"):
        pl.export_vrml(tmp_path / "a.vrml")
    assert "Traceback" not in capfd.readouterr().err
    assert "Shape" in (tmp_path / "a.vrml").read_text()
    assert pl.decals.subplot.actor.GetVisibility()
    assert np.ptp(shot(pl)) > 0


GREENS = np.full((64, 64, 3), 255, np.uint8)
GREENS[..., 1] = np.add.outer(np.arange(0, 192, 3), np.arange(64))
"""A texture that leaves red and blue decals as they are, as VTK multiplies them by it."""
ACTORS: dict[str, Callable[[pv.PolyData], dict[str, Any]]] = {
    "color": lambda _: {"color": (0.8, 0.4, 0.2)},
    "points": lambda ball: {"scalars": ball.points[:, 2]},
    "cells": lambda ball: {"scalars": np.arange(ball.n_cells) // 700, "n_colors": 5},
    "texture": lambda _: {"texture": GREENS},
}
"""Options of actors with a colour, scalars of points and cells, and a texture."""


@pytest.mark.parametrize("look", ACTORS)
@pytest.mark.parametrize("follow", [True, False])
def test_decals_on_actors_are_baked(
    plotter: Factory, monkeypatch: pytest.MonkeyPatch, look: str, follow: bool
) -> None:
    """Without light, the actor with baked decals looks as that whose shader draws them."""
    need("xatlas")
    seen: list[Array] = []
    monkeypatch.setattr(pv.Plotter, "export_gltf", lambda plotter, _: seen.append(shot(plotter)))
    pl: Any = plotter()
    ball: Any = pv.Sphere(theta_resolution=40, phi_resolution=40).texture_map_to_sphere()
    actor = pl.add_mesh(ball, lighting=False, **ACTORS[look](ball))
    actor.user_matrix = np.array([[0, -2, 0, 1], [2, 0, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1.0]])
    place = Decals(
        positions=[(0.1, 0.1, 0.5), (0.3, 0, 0.4)],
        normals=[(0, 0, 1)] * 2,
        tangents=[(1, 0, 0)] * 2,
        radii=0.25,
    )
    if not follow:
        matrix = np.asarray(actor.user_matrix)
        turn = matrix[:3, :3] / 2
        place = place.replace(
            positions=place.positions @ matrix[:3, :3].T + matrix[:3, 3],
            normals=place.normals @ turn.T,
            tangents=place.tangents @ turn.T,
            radii=2 * place.radii,
        )
    pl.decals.apply(actor, follow=follow, labels=["ball"])
    pl.decals.add(place.replace(images=[-1, -1], tints=[(1, 0, 0), (0, 0, 1)], receivers=["", ""]))
    pl.view_xy()
    live = shot(pl)
    pl.export_gltf("a.gltf")
    np.testing.assert_array_equal(shot(pl), live)
    (baked,) = seen
    inner = (baked != live[0, 0]).any(axis=2) & (live != live[0, 0]).any(axis=2)
    off = np.abs(baked - live).max(axis=2)[inner]
    assert inner.mean() > 0.1
    assert (off <= 12).mean() > 0.97
    hits = [(live[..., one] > 2 * live[..., other]) & inner for one, other in ((0, 2), (2, 0))]
    assert np.min([hit.sum() for hit in hits]) > 100


def test_an_export_that_fails_leaves_the_plotter_as_it_was(plotter: Factory, tmp_path: Path) -> None:
    need("xatlas")
    pl: Any = shown(plotter, ball_and_cube(count=2))
    actors = set(pl.renderer.actors)
    with pytest.raises(ValueError, match="obj"):
        pl.export_obj(tmp_path / "a.txt")
    assert set(pl.renderer.actors) == actors
    assert pl.decals.subplot.actor.GetVisibility()


class Trame:
    """Stands in for pyvista's component of trame, whose exports call each other."""

    def __init__(self, plotter: Plotter) -> None:
        self._plotter = plotter
        self.written: list[set[str]] = []

    def export_html(self) -> None:
        self.export_vtksz()

    def export_vtksz(self) -> None:
        actors = self._plotter.renderer.actors.items()
        self.written.append({name for name, actor in actors if actor.GetVisibility()})


def test_exports_of_the_component_of_trame_are_watched(plotter: Factory) -> None:
    pl = plotter()
    component = pl.__dict__["trame"] = Trame(pl)
    pl.decals.add_scene(both(), camera=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        component.export_html()
    with pytest.warns(UserWarning, match="export_vtksz writes VTK's own actors"):
        component.export_vtksz()
    assert component.written == [{f"{exports.BAKED} 0"}, set()]
    pl.close()
    assert "export_html" not in vars(component)
