"""Test meshes, test images, cameras and the drawing of panels for the gallery's examples."""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals import Camera, DecalImage, Decals, ImageMapping, MeshObject, Scene
from decals.apps.gallery import SIDE
from decals.apps.models.samples import axes_of, sample
from decals.apps.views import frame, parse_view
from decals.field.rules import AnyContact
from decals.rendering import Environment, Picture, Renderer
from decals.rendering.options import RenderOptions
from decals.scenes.pose import PosedScene
from decals.scenes.render import picture_record

Vector = tuple[float, float, float]
MeshArrays = tuple[NDArray[np.float32], NDArray[np.int32]]
"""Vertices and faces of a mesh."""

CLAY = (0.74, 0.71, 0.66)
"""The colour of models without decals."""

GALLERY_FUNCTION = "implicit-decals gallery"
"""Function in the recipes of examples' pictures."""

GAP = 4
"""Width of the white gap between panels, in pixels."""


@dataclass(frozen=True)
class Panel:
    """A scene, the modes in which its decals are drawn, and its environment."""

    scene: Scene | PosedScene
    contact: AnyContact = RenderOptions.contact
    mapping: ImageMapping = ImageMapping.CORRECTED
    environment: Environment | None = None


def draw(
    renderer: Renderer, panels: Sequence[Panel], *, side: int = SIDE, samples: int = 3
) -> NDArray[np.uint8]:
    """Draw panels from left to right.

    Parameters
    ----------
    renderer : decals.rendering.Renderer
    panels : sequence of Panel
    side : int
        Width and height of a panel, in pixels.
    samples : int
        Samples per pixel along each axis.

    Returns
    -------
    uint8[side, width, 4]
    """
    width = len(panels) * (side + GAP) - GAP
    row = np.full((side, width, 4), 255, np.uint8)
    for number, panel in enumerate(panels):
        left = number * (side + GAP)
        row[:, left : left + side] = renderer.render(
            panel.scene,
            RenderOptions(
                size=(side, side),
                samples=samples,
                contact=panel.contact,
                mapping=panel.mapping,
                environment=panel.environment,
            ),
        )
    return row


def example_picture(renderer: Renderer, name: str, panels: Sequence[Panel], side: int) -> Picture:
    """Return the picture of an example with its recipe."""
    parameters = {"example": name, "side": side}
    return Picture(draw(renderer, panels, side=side), picture_record(renderer, GALLERY_FUNCTION, parameters))


def main(panels: Callable[[], Sequence[Panel]]) -> None:
    """Draw an example into the file named on the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("-o", "--output", type=Path, default=Path("picture.png"))
    parser.add_argument("--side", type=int, default=SIDE, help="width and height of a panel, in pixels")
    options = parser.parse_args()
    with Renderer() as renderer:
        example_picture(renderer, Path(sys.argv[0]).stem, panels(), options.side).save(options.output)


def camera_above(height: float = 4.2) -> Camera:
    """Return a camera on the z axis that looks at the xy plane."""
    return Camera(position=(0.0, 0.0, height), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=28.0)


def camera_at(
    position: Vector, target: Vector = (0.0, 0.0, 0.0), *, up: Vector = (0.0, 0.0, 1.0), fov: float = 28.0
) -> Camera:
    """Return a camera at a position that looks at a target."""
    return Camera(position=position, target=target, up=up, fov=fov)


def sample_camera(name: str) -> Camera:
    """Return a camera from which a sample model fills a square picture."""
    return frame([sample(name)], parse_view(None, axes_of(name)), (1, 1))


def flat_decals(positions: ArrayLike, radius: ArrayLike, *, tangent: ArrayLike = (1.0, 0.0, 0.0)) -> Decals:
    """Return decals whose normals are the z axis; one radius stands for all."""
    places = np.asarray(positions, np.float32)
    normals, tangents = (np.tile(np.array(one, np.float32), (len(places), 1)) for one in ((0, 0, 1), tangent))
    return Decals(places, normals, tangents, np.asarray(radius, np.float32))


def single_decal(
    position: ArrayLike,
    normal: ArrayLike,
    radius: float,
    *,
    tangent: ArrayLike = (1.0, 0.0, 0.0),
    image: int = 0,
) -> Decals:
    """Return one decal."""
    place, up, along = (np.array([one], np.float32) for one in (position, normal, tangent))
    return Decals(place, up, along, radius, images=image)


def disc(edge: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return x, y and the distance from the centre at the pixels of a map; the rim lies at distance 1."""
    step = (np.arange(edge) + 0.5) / edge * 2 - 1
    x, y = np.meshgrid(step, -step, indexing="xy")
    return x, y, np.hypot(x, y)


def checker_image(squares: int = 8, *, edge: int = 256) -> DecalImage:
    """Draw a checkerboard with a frame and a red centre, which makes the distortion of a mapping visible."""
    i, j = np.indices((edge, edge))
    x, y = (i + 0.5) / edge, (j + 0.5) / edge
    dark = (np.floor(x * squares) + np.floor(y * squares)) % 2 == 0
    pixels = np.where(dark[..., None], [38, 84, 124, 255], [240, 236, 220, 255]).astype(np.uint8)
    radius = np.hypot(x - 0.5, y - 0.5)
    pixels[radius < 0.06] = [200, 60, 40, 255]
    pixels[(radius > 0.47) & (radius <= 0.5)] = [20, 20, 20, 255]
    pixels[radius > 0.5] = 0
    return DecalImage("checker", pixels)


def ring_image(color: tuple[int, int, int] = (214, 156, 64), *, edge: int = 256) -> DecalImage:
    """Draw concentric rings with a black rim, which show how far neighbours push a decal."""
    i, j = np.indices((edge, edge))
    radius = 2 * np.hypot((i + 0.5) / edge - 0.5, (j + 0.5) / edge - 0.5)
    shade = np.where(np.floor(radius * 6) % 2 == 0, 1.0, 0.8)[..., None]
    pixels = np.empty((edge, edge, 4), np.uint8)
    pixels[..., :3] = np.asarray(color) * shade
    pixels[..., 3] = 255
    pixels[radius > 0.93] = [15, 15, 15, 255]
    return DecalImage("rings", pixels)


def plane(half: float = 1.0) -> MeshObject:
    """Make a square in the xy plane that faces +z."""
    corners = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    return MeshObject("plane", corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), color=CLAY)


def cube(half: float = 0.8) -> MeshArrays:
    """Make a cube with sharp edges: each face has its own corners."""
    vertices: list[NDArray[np.float64]] = []
    faces: list[list[int]] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            normal = side * np.eye(3)[axis]
            faces += [[len(vertices) + i for i in face] for face in ((0, 1, 2), (0, 2, 3))]
            vertices += [
                normal - side * u - v,
                normal + side * u - v,
                normal + side * u + v,
                normal - side * u + v,
            ]
    return (half * np.array(vertices)).astype(np.float32), np.array(faces, np.int32)


def plate(hole: float = 0.3, *, half: float = 1.0, thickness: float = 0.3, around: int = 64) -> MeshArrays:
    """Make a square plate in the xy plane with a round hole in its middle."""
    angle = np.arange(around + 1) * (2 * np.pi / around) + np.pi / 4
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inner, outer = hole * ring, half * ring / np.abs(ring).max(axis=1, keepdims=True)
    top, low = thickness / 2, -thickness / 2
    strips = [
        (inner, top, outer, top),
        (outer, top, outer, low),
        (outer, low, inner, low),
        (inner, low, inner, top),
    ]
    vertices: list[NDArray[np.float64]] = []
    faces: list[list[int]] = []
    for first, z_first, second, z_second in strips:
        base = sum(len(part) for part in vertices)
        for points, z in ((first, z_first), (second, z_second)):
            vertices.append(np.column_stack([points, np.full(len(points), z)]))
        for i in range(around):
            a, b, c, d = base + i, base + i + 1, base + around + 1 + i, base + around + 2 + i
            faces += [[a, c, d], [a, d, b]]
    return np.concatenate(vertices).astype(np.float32), np.array(faces, np.int32)


def bumps(side: int = 80) -> MeshArrays:
    """Make a square of rolling bumps over the xy plane."""
    grid = np.linspace(-1, 1, side)
    x, y = np.meshgrid(grid, grid, indexing="ij")
    z = 0.12 * np.cos(7 * x) * np.cos(7 * y)
    i, j = np.meshgrid(np.arange(side - 1), np.arange(side - 1), indexing="ij")
    a = (i * side + j).reshape(-1)
    b, c, d = a + side, a + side + 1, a + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), faces.astype(np.int32)
