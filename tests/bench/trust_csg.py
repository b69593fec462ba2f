"""Holes in pictures of sharp CSG: pixels that miss, or see through, where a ray is deep inside in float64."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blobtree import Node
from decals.rendering.options import RenderOptions
from decals.rendering.renderer import Renderer
from decals.scenes.camera import Camera
from tests.blobtree.csg_trees import csg_tree
from tests.decals.glsl.tapes import Model
from tests.decals.shapes import View
from tests.oracles.csg import deep_hits

TARGETS = {"csg_holes": "0", "csg_ray_holes": "0"}

DEPTH = 1e-4
"""How deep a ray must be inside, over the diagonal of the model's box."""

MAX_DEPTH = 4
"""Depth of the deepest trees."""

TREES, QUICK_TREES = 100, 12
SIZE, QUICK_SIZE = (160, 120), (60, 45)


@dataclass(frozen=True)
class Holes:
    """Pixels that must show the surface; those of them that do not, in a picture and among traced rays."""

    pixels: int
    of_picture: int
    of_rays: int


def measure(seed: int = 1, *, quick: bool) -> dict[str, float]:
    """Draw random trees that are not empty from random directions, and count the holes."""
    rng = np.random.default_rng(seed)
    found: list[Holes] = []
    with Renderer() as renderer:
        while len(found) < (QUICK_TREES if quick else TREES):
            tree, direction = visible_tree(rng, 1 + len(found) % MAX_DEPTH), rng.normal(size=3)
            holes = holes_of(tree, direction, renderer, QUICK_SIZE if quick else SIZE)
            found += [holes] if holes.pixels else []
    return {
        "csg_holes": sum(holes.of_picture for holes in found),
        "csg_ray_holes": sum(holes.of_rays for holes in found),
        "csg_cases": len(found),
        "csg_pixels": sum(holes.pixels for holes in found),
    }


def visible_tree(rng: np.random.Generator, depth: int) -> Node:
    """A random tree of this depth at most that is not empty."""
    while True:
        tree = csg_tree(rng, depth)
        if bool((tree.support[1] > tree.support[0]).all()):
            return tree


def holes_of(tree: Node, direction: NDArray[np.float64], renderer: Renderer, size: tuple[int, int]) -> Holes:
    """Return the holes of a tree in a view of all of it; pixels beside a silhouette do not count."""
    width, height = size
    camera = Camera.framing(tree.support, direction=tuple(direction.tolist()), aspect=width / height)
    x, y = np.meshgrid(np.arange(width) + 0.5, height - np.arange(height) - 0.5)
    rays = camera.rays(width, height)
    directions = rays.directions(x, y).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = np.broadcast_to(rays.origin, directions.shape)
    depth = DEPTH * float(np.linalg.norm(tree.support[1] - tree.support[0]))
    deep = deep_hits(tree, origins, directions, depth)
    counted = _surrounded(np.isfinite(deep).reshape(height, width)).ravel()
    buffers = renderer.buffers(View((Model(tree),), camera), RenderOptions(size=size))
    distances = np.linalg.norm(buffers.position.reshape(-1, 3) - rays.origin, axis=1)
    distances = np.where(buffers.object_id.ravel() < 0, np.inf, distances)
    traced = tree.raycast(origins, directions).distances
    late = (distances > deep + depth) & counted, (traced > deep + depth) & counted
    return Holes(int(counted.sum()), *(int(pixels.sum()) for pixels in late))


def _surrounded(hits: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the hits among whose eight neighbours is no miss."""
    padded = np.pad(hits, 1, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    return np.asarray(windows.all(axis=(2, 3)))
