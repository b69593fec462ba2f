"""``implicit-decals demo``: three pictures that show the method, and their scenes.

Two pictures show a creature and its egg: under scales, and a close-up in tiles. The creature is an implicit
surface, the egg a mesh. The particles spread over both at once, so scales push each other where they touch.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from blobtree import Progress
from blobtree._typing import Float32Array, Int32Array
from blobtree.graphics import require_screen
from decals import Camera, DecalImage, Decals, MeshObject, Scene, TreeObject, scatter
from decals.apps.commands.activation import command_lines
from decals.apps.commands.options import MAX_SAMPLES, TILE, Whole, check_count, parse_size
from decals.apps.commands.progress_bars import PREPARING, progress_bars
from decals.apps.gallery import spanning
from decals.apps.models.shapes import creature, egg
from decals.apps.output import check_output, print_path
from decals.errors import InvalidInput, NoGraphics
from decals.output_folder import output_folder
from decals.rendering import Picture, Renderer
from decals.rendering.options import RenderOptions, Size
from decals.scenes.render import picture_record

PICTURES = ("hero.png", "contact.png", "span.png")

DEMO_FUNCTION = "implicit-decals demo"
"""Function in the recipes of these pictures."""

COUNT = 1100
EYE_RADIUS = 0.23
_EYE_CLEARANCE = 0.24
"""Distance from an eye within which no scale lies: nested with it, it would lie above it."""
_EYES = np.array([[1.06, 2.29, 0.45], [1.06, 2.29, -0.45]], np.float32)
"""Positions of the creature's eyes, before they are projected onto its surface."""

_EGG_CENTER = np.array([1.33, 0.66, 0.0], np.float32)
_EGG_RADIUS, _EGG_HEIGHT = 0.56, 0.70
_SCALES = (
    "scale#2f7f8c",
    "scale#3a8a6a",
    "scale#4f9448",
    "scale#76a83a",
    "scale#a8b437",
    "scale#cf9f34",
    "scale#cf7a30",
    "scale#c4512f",
    "scale#9c3542",
)
"""Images of the scales, from the tip of the tail to the egg."""

_UP = np.array([0.0, 1.0, 0.0], np.float32)
_BACKWARD = np.array([-1.0, -0.55, 0.0], np.float32)
_EGG_TOLERANCE = 1.08
"""Points within this many radii of the egg's centre lie on it: its thick end bulges out of the ellipsoid."""

_GLAZES = ("tile#2f7f95", "tile#c9a227", "tile#b5533c", "tile#e4dcc8", "tile#3f6b4f")


def demo(
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))] = Path("out"),
    size: str = "1200x900",
    samples: Whole = 2,
) -> None:
    """Draw three pictures that show the method.

    hero.png: an implicit creature and a mesh, covered with scales. contact.png: a close-up of tiles that
    push each other. span.png: one decal across a mesh and an implicit surface.

    Parameters
    ----------
    output
        Folder for the pictures. It is created if it does not exist.
    size
        Width and height of the pictures in pixels.
    samples
        Samples per pixel along each axis: 1 is fast, 2 smooth, 4 fine.
    """
    pixels = parse_size(size)
    check_count("--samples", samples, 1, MAX_SAMPLES)
    with output_folder(output, InvalidInput):
        for name in PICTURES:
            check_output(output / name, (".png",))
        with progress_bars() as progress:
            for name, picture in demo_pictures(PICTURES, pixels, samples, progress):
                picture.save(output / name)
    for name in PICTURES:
        print_path(output / name)
    lines = "\n".join(f"  {line}" for line in command_lines(next_commands()))
    Console(stderr=True).print(
        f"\nNext, type in this shell:\n\n{lines}", soft_wrap=True, highlight=False, markup=False
    )


def demo_pictures(
    names: Sequence[str], size: Size, samples: int, progress: Progress
) -> Iterator[tuple[str, Picture]]:
    """Yield some of the pictures with their recipes."""
    with Renderer(max_tile=TILE) as renderer:
        progress(PREPARING, 0.0)
        nest = nest_scene(progress=progress)
        scenes = dict(zip(PICTURES, (nest, tile_scene(nest), spanning.scene(fov=27.0)), strict=True))
        for name in names:
            progress(f"drawing {name}", 0.0)
            pixels = renderer.render(scenes[name], RenderOptions(size=size, samples=samples))
            parameters = {"picture": name, "size": list(size), "samples": samples}
            yield name, Picture(pixels, picture_record(renderer, DEMO_FUNCTION, parameters))


def next_commands() -> list[str]:
    """Return the commands to try after the demo; those with a window only if there is a screen."""
    commands = ["gallery", "render knot --decals 800 -o knot.png"]
    try:
        require_screen()
    except NoGraphics:
        return commands
    return [*commands, "edit knot --decals 300 --image scale --image eye"]


def nest_scene(*, progress: Progress) -> Scene:
    """Cover the creature and the egg with scales that point toward the tail, or up the egg.

    Parameters
    ----------
    progress : blobtree.Progress
        Reports the scattering.
    """
    objects = TreeObject("creature", creature()), _egg()
    eyes = _eyes(objects[0])
    scales = scatter(
        [item.surface for item in objects],
        count=COUNT,
        mask=lambda points: _distances(points, eyes.positions) > _EYE_CLEARANCE,
        direction=_directions,
        progress=progress,
    )
    scales = scales.replace(images=_choose_images(scales.positions))
    return Scene(
        objects=objects,
        camera=Camera(position=(4.1, 2.7, 6.6), target=(0.10, 1.16, 0.10), fov=24.0),
        images=tuple(DecalImage.load(name) for name in (*_SCALES, "eye")),
        decals=Decals.concatenate([scales, eyes]),
    )


def tile_scene(scene: Scene) -> Scene:
    """Show the decals of the nest scene as glazed tiles, where a paw touches the egg."""
    chosen = np.random.default_rng(3).integers(0, len(_GLAZES), len(scene.decals))
    return scene.replace(
        images=tuple(DecalImage.load(name) for name in _GLAZES),
        decals=scene.decals.replace(images=chosen.astype(np.int32)),
        camera=Camera(position=(2.3, 1.5, 3.6), target=(0.98, 0.82, 0.42), fov=20.0),
    )


def _egg() -> MeshObject:
    vertices, faces = egg(_EGG_CENTER, radius=_EGG_RADIUS, height=_EGG_HEIGHT)
    return MeshObject("egg", vertices, faces, color=(0.86, 0.80, 0.68))


def _directions(points: Float32Array) -> Float32Array:
    """Return the directions of the scales: from head to tail on the creature, upward on the egg."""
    sizes = np.array([_EGG_RADIUS, _EGG_HEIGHT, _EGG_RADIUS], np.float32)
    on_egg = np.linalg.norm((points - _EGG_CENTER) / sizes, axis=1, keepdims=True) < _EGG_TOLERANCE
    return np.where(on_egg, _UP, _BACKWARD)


def _choose_images(points: Float32Array) -> Int32Array:
    """Choose an image for each scale: a gradient from the tail to the egg, with random variation."""
    gradient = np.clip((points[:, 0] - 0.25 * points[:, 1] + 2.1) / 3.6, 0.0, 1.0)
    jitter = np.random.default_rng(7).uniform(-0.7, 0.7, len(points))
    return np.clip(np.rint(gradient * (len(_SCALES) - 1) + jitter), 0, len(_SCALES) - 1).astype(np.int32)


def _eyes(body: TreeObject) -> Decals:
    """Return the two eyes of the creature."""
    positions, normals = body.surface.project(_EYES)
    return Decals(
        positions=positions,
        normals=normals,
        tangents=np.cross(_UP, normals),
        radii=np.full(len(positions), EYE_RADIUS, np.float32),
        images=np.full(len(positions), len(_SCALES), np.int32),
    )


def _distances(points: Float32Array, centers: Float32Array) -> Float32Array:
    """Return the distance of each point from the closest centre."""
    gaps: Float32Array = np.linalg.norm(points[:, None] - centers, axis=2).min(axis=1)
    return gaps
