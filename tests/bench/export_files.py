"""Exported files: read back by all readers, baked textures beside pictures, and the error of distances."""

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

import blobtree
import decals
from decals.images.texels import encode_srgb
from decals.rendering import Lighting
from decals.surfaces.mesh_file import read_mesh_data
from tests.blobtree.sampling.test_field_grid import EXACT, rows_of
from tests.decals.baking.exported import FORMATS, READERS, random_scene
from tests.decals.baking.glb import read_glb
from tests.decals.baking.test_export import RESOLUTION, expected

Array = NDArray[Any]

TARGETS = {
    "files_wrong": "0",
    "bake_psnr": ">= 40 at 4096",
    "bake_seam": "<= 4 of 255",
    "bake_unassigned": "0",
    "bake_s": "30 at 4096 on two cores",
    "distance_over_stated": "<= 1",
}
"""Targets; counts stand beside their numbers of cases."""

SCENES, QUICK_SCENES = 100, 3
"""Random scenes that are written in each format."""

TEXELS, QUICK_TEXELS = 4096, 512
DECALS, QUICK_DECALS = 1000, 40
"""Size of the baked texture, and the decals in it."""

PICTURE = (800, 600)
"""Size of the pictures that are compared."""

SEAM_STEPS = 32
"""Points along each edge on both sides of a seam, at most."""


def measure(seed: int = 1, *, quick: bool) -> dict[str, float]:
    """Return the figures of files, of a baked texture, and of distances."""
    return {
        **files(seed, QUICK_SCENES if quick else SCENES),
        **baked(QUICK_TEXELS if quick else TEXELS, QUICK_DECALS if quick else DECALS),
        **distances(),
    }


def files(seed: int, count: int) -> dict[str, float]:
    """Count the files in which a reader finds other surfaces than those of the scene."""
    cases = wrong = 0
    for number in range(seed, seed + count):
        want = expected(number)
        with tempfile.TemporaryDirectory() as folder:
            for suffix, readers in FORMATS.items():
                path = Path(folder) / f"scene{suffix}"
                for reader in readers:
                    try:
                        __import__(reader)
                    except ImportError:
                        continue
                    if not path.exists():
                        colors = None if suffix == ".stl" else "vertices"
                        decals.export(random_scene(number), path, colors=colors, resolution=RESOLUTION)
                    cases += 1
                    wrong += not np.array_equal(READERS[reader](path).ordered.triangles, want.triangles)
    return {"files_wrong": wrong, "files_cases": cases}


def baked(texels: int, count: int) -> dict[str, float]:
    """Compare a ball and a box with baked decals, drawn by VTK without light, with the live picture."""
    ball = blobtree.Point((0, 0, 0), radius=1.0)
    scene = decals.cover(
        [ball, pv.Cube(center=(1.6, 0, 0)).triangulate()], count=count, images=["scale", "eye"]
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.glb"
        began = time.perf_counter()
        decals.bake(scene, path, size=texels)
        seconds = time.perf_counter() - began
        nodes = read_glb(path)
        seam = seam_difference(path)
    texture = next(iter(nodes.values())).texture
    assert texture is not None
    return {
        "bake_psnr": psnr(scene, list(nodes.values())),
        "bake_seam": seam,
        "bake_unassigned": int((texture == 0).all(axis=2).sum()),
        "bake_texels": texels,
        "bake_decals": count,
        "bake_s": seconds,
    }


def psnr(scene: decals.Scene, nodes: list[Any]) -> float:
    """Return the ratio of signal to noise over the pixels in which both pictures show the surface, in dB."""
    live = np.asarray(decals.render(scene, size=PICTURE, samples=4, lights=Lighting(()), background="white"))
    make_texture: Any = pv.Texture
    plotter = pv.Plotter(off_screen=True, window_size=[4 * side for side in PICTURE], lighting=None)
    for node in nodes:
        mesh = pv.PolyData.from_regular_faces(node.vertices, node.faces)
        mesh.active_texture_coordinates = node.uv
        texture = make_texture(node.texture)
        texture.interpolate = texture.mipmap = True
        plotter.add_mesh(mesh, texture=texture, lighting=False)
    camera = scene.camera.at(PICTURE[0] / PICTURE[1])
    plotter.camera_position = [camera.position, camera.target, camera.up]
    plotter.camera.view_angle = camera.fov
    plotter.renderer.set_background("white")
    large = np.asarray(plotter.screenshot(return_img=True), float)
    plotter.close()
    height, width = PICTURE[1], PICTURE[0]
    linear = ((large / 255 + 0.055) / 1.055) ** 2.4
    drawn = 255 * encode_srgb(linear.reshape(height, 4, width, 4, 3).mean(axis=(1, 3)))
    shown = [np.asarray((picture < 252).any(axis=2)) for picture in (live[..., :3], drawn)]
    surface = inner(shown[0] & shown[1])
    error = float(((live[..., :3].astype(float) - drawn)[surface] ** 2).mean())
    return float(10 * np.log10(255**2 / error))


def inner(mask: Array) -> Array:
    """Return the pixels whose eight neighbours belong to a mask too: silhouettes are left out."""
    kept = mask.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            kept &= np.roll(kept, step, axis)
    return kept


def seam_difference(path: Path) -> float:
    """Return the median difference, of 255, of the texture on the two sides of the seams of its charts."""
    data = read_mesh_data(path)
    assert data.color is not None
    vertices = np.asarray(data.vertices, float)
    _, welded = np.unique(vertices, axis=0, return_inverse=True)
    sides: dict[tuple[int, int], list[tuple[int, int, int]]] = {}
    for face, corners in enumerate(data.faces.tolist()):
        for k in range(3):
            a, b = corners[k], corners[(k + 1) % 3]
            same = welded[a], welded[b]
            sides.setdefault((min(same), max(same)), []).append((face, k, int(same[0] > same[1])))
    pairs = [found for found in sides.values() if len(found) == 2]
    shares = (np.arange(SEAM_STEPS) + 0.5) / SEAM_STEPS
    colors = []
    for side in (0, 1):
        faces, firsts, turned = np.array([found[side] for found in pairs]).T
        t = np.where(turned[:, None] == 1, 1 - shares, shares)
        weights = np.zeros((len(pairs), SEAM_STEPS, 3))
        rows = np.arange(len(pairs))
        for step in range(SEAM_STEPS):
            weights[rows, step, firsts] = 1 - t[:, step]
            weights[rows, step, (firsts + 1) % 3] = t[:, step]
        light = data.color.light_at(data.faces, np.repeat(faces, SEAM_STEPS), weights.reshape(-1, 3))
        colors.append(255 * np.asarray(encode_srgb(light)))
    gaps = np.abs(colors[0] - colors[1]).max(axis=1)
    other = gaps > 1e-9  # within a chart both sides are one point of the texture
    return float(np.median(gaps[other])) if other.any() else 0.0


def distances() -> dict[str, float]:
    """Return the largest ratio of the measured error of signed distances to the stated one."""
    ratios = []
    for tree, exact in EXACT.values():
        grid = blobtree.field_grid(tree, resolution=32, distance=True)
        assert grid.error is not None
        off = np.abs(grid.values.reshape(-1) - exact(rows_of(grid)))
        ratios.append(float(off.max()) / grid.error)
    return {"distance_over_stated": max(ratios), "distance_cases": len(ratios)}
