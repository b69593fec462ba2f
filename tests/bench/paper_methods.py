"""Benchmark of the paper's three ways to draw decals: ``python -m tests.bench.decals --only methods``.

Section 3.4 names a ray tracer that evaluates decals at every hit, image coordinates at the vertices of a
polygonized model, and the fragment shader. All three draw the implicit spheres of figure 12 here, under the
contact of equation 5. The errors are those of image coordinates at random points of the triangles (vertices)
and at all pixels (fragment shader), beside the float64 oracle of the tests. `draw` paints the same scene by
vertices and by the fragment shader.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, cast

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image

from blobtree import Mesh, Node, polygonize
from decals import Camera, Contact, DecalImage, Decals, Scene, TreeObject, evaluate, scatter
from decals.apps.gallery.helpers import CLAY, sample_camera
from decals.apps.models.shapes import spheres
from decals.rendering import Renderer, RenderOptions
from tests.oracles import decals as oracle

COUNT = 500
SIZE = (800, 600)
CELLS = {"coarse": 0.12, "fine": 0.03}
"""Cell sizes of the polygonized models."""

POINTS = 20_000
WRONG = 0.02
"""Error of image coordinates from which a point is wrong: a fiftieth of the image."""

RUNS = 3
Figures = dict[str, float]
Float64Array = NDArray[np.float64]
Owners = NDArray[np.int32]


def scaled_spheres(*, count: int = COUNT) -> tuple[Node, Decals]:
    """Return the implicit spheres of figure 12, and scales for them."""
    tree = spheres()
    return tree, scatter(TreeObject("spheres", tree).surface, count=count)


def at_vertices(decals: Decals, mesh: Mesh) -> tuple[Owners, NDArray[np.float32]]:
    """Return owner and image coordinates at the vertices of a mesh."""
    samples = evaluate(decals, mesh.vertices, mesh.normals, contact=Contact.PRODUCT)
    return samples.owner, samples.uv


def measure(*, quick: bool) -> Figures:
    """Measure the three methods."""
    tree, decals = scaled_spheres(count=100 if quick else COUNT)
    size = (200, 150) if quick else SIZE
    scene = Scene(
        objects=(TreeObject("spheres", tree),),
        camera=sample_camera("spheres"),
        images=(DecalImage.load("scale"),),
        decals=decals,
    )
    figures = {**_fragment(scene, size, points=POINTS // 10 if quick else POINTS)}
    rays = scene.camera.rays(*size)
    x, y = (part.reshape(-1) + 0.5 for part in np.meshgrid(np.arange(size[0]), np.arange(size[1])))

    def trace() -> None:
        hits = tree.raycast(rays.origins(x, y), rays.directions(x, y))
        evaluate(decals, hits.positions[hits.hit], hits.normals[hits.hit], contact=Contact.PRODUCT)

    figures["ray_tracer_s"] = _least(trace)
    for name, cell_size in CELLS.items():
        mesh = polygonize(tree, cell_size=cell_size)
        figures[f"{name}_triangles"] = len(mesh.faces)
        figures[f"{name}_vertices_s"] = _least(partial(at_vertices, decals, mesh))
        figures |= {f"{name}_{key}": value for key, value in _vertex_errors(decals, mesh).items()}
    return figures


def _fragment(scene: Scene, size: tuple[int, int], *, points: int) -> Figures:
    """Measure a frame of the decal pass, and its errors at some of the pixels that show decals."""
    options = RenderOptions(size=size, samples=1, contact=Contact.PRODUCT)
    with Renderer() as renderer:
        frame = _least(lambda: renderer.time_frame(scene, options))
        buffers = renderer.buffers(scene, options)
    shown = np.flatnonzero(buffers.owner.reshape(-1) >= 0)
    some = np.random.default_rng(0).choice(shown, min(points, len(shown)), replace=False)
    exact = oracle.decals_at(
        scene.decals, buffers.position.reshape(-1, 3)[some], buffers.normal.reshape(-1, 3)[some]
    )
    return {
        "fragment_frame_s": frame,
        **_errors(
            "fragment_",
            buffers.owner.reshape(-1)[some],
            buffers.uv.reshape(-1, 2)[some],
            exact.owner,
            exact.uv,
        ),
    }


def _vertex_errors(decals: Decals, mesh: Mesh) -> Figures:
    """Return the errors of coordinates that are interpolated between vertices, at random points."""
    owner, uv = at_vertices(decals, mesh)
    rng = np.random.default_rng(1)
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(areas), POINTS, p=areas / areas.sum())
    weights = rng.dirichlet(np.ones(3), POINTS)

    def mixed(values: NDArray[np.float32]) -> Float64Array:
        result: Float64Array = np.einsum("nc,nck->nk", weights, values[mesh.faces[face]].astype(np.float64))
        return result

    points, normals = mixed(mesh.vertices), mixed(mesh.normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    exact = evaluate(decals, points, normals, contact=Contact.PRODUCT)
    owners = owner[mesh.faces[face]]
    same = (owners == owners[:, :1]).all(axis=1)
    drawn = np.where(same, owners[:, 0], -2)
    return {
        "border_share": float(1.0 - same.mean()),
        **_errors("", drawn, mixed(uv), exact.owner, exact.uv.astype(np.float64)),
    }


def _errors(
    prefix: str, drawn: Owners, uv: NDArray[np.floating], owner: Owners, exact: Float64Array
) -> Figures:
    """Return the share of wrong points, and the largest error of coordinates where the owner is right."""
    distance = np.linalg.norm(uv - exact, axis=1)
    right = (drawn == owner) & (owner >= 0)
    wrong = ((owner >= 0) | (drawn != -1)) & (~right | (distance > WRONG))
    return {
        f"{prefix}wrong": float(wrong.mean()),
        f"{prefix}uv_rms": float(np.sqrt((distance[right] ** 2).mean())),
    }


def draw(*, side: int = 300) -> Image.Image:
    """Draw part of the spheres by a coarse mesh's vertices, by a fine mesh's, and by the fragment shader."""
    tree, decals = scaled_spheres()
    image = DecalImage.load("scale#4d8a57")
    camera = replace(sample_camera("spheres"), fov=14.0)
    panels = [
        _by_vertices(decals, polygonize(tree, cell_size=size), image, camera, side) for size in CELLS.values()
    ]
    scene = Scene(
        objects=(TreeObject("spheres", tree),),
        camera=camera,
        images=(image,),
        decals=decals,
    )
    with Renderer() as renderer:
        shown = renderer.render(scene, RenderOptions(size=(side, side), samples=3, contact=Contact.PRODUCT))
    panels.append(Image.fromarray(np.asarray(shown)).convert("RGB"))
    row = Image.new("RGB", (len(panels) * (side + 4) - 4, side), "white")
    for number, panel in enumerate(panels):
        row.paste(panel, (number * (side + 4), 0))
    return row


def _by_vertices(decals: Decals, mesh: Mesh, image: DecalImage, camera: Camera, side: int) -> Image.Image:
    """Draw with image coordinates at vertices, as graphics hardware does."""
    owner, uv = at_vertices(decals, mesh)
    model: Any = pv.PolyData.from_regular_faces(mesh.vertices.astype(float), mesh.faces.astype(int))
    model.point_data.active_normals = mesh.normals
    model.active_texture_coordinates = np.where(owner[:, None] >= 0, [[1, -1]] * uv + [[0, 1]], 0.0)
    pixels = image.pixels.astype(np.float64)
    alpha = pixels[..., 3:] / 255
    over = alpha * pixels[..., :3] + (1 - alpha) * 255 * np.array(CLAY)
    texture = cast(Any, pv.Texture)(over.astype(np.uint8))
    texture.repeat = False
    texture.interpolate = True
    plotter: Any = pv.Plotter(off_screen=True, window_size=[side, side])
    plotter.set_background("white")
    plotter.add_mesh(model, texture=texture, smooth_shading=True)
    plotter.camera.position, plotter.camera.focal_point = camera.position, camera.target
    plotter.camera.up, plotter.camera.view_angle = camera.up, camera.fov
    plotter.reset_camera_clipping_range()
    picture = plotter.screenshot(return_img=True)
    plotter.close()
    return Image.fromarray(np.asarray(picture))


def _least(work: Callable[[], object]) -> float:
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)
