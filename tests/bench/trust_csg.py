"""Holes in pictures of sharp CSG: pixels that miss, or see through, where a ray is deep inside in float64."""

from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from blobtree import Node
from decals.rendering.options import RenderOptions
from decals.rendering.renderer import Renderer
from decals.scenes.camera import Camera
from tests.blobtree.csg_trees import visible_tree
from tests.blobtree.trees import triple
from tests.decals.glsl.tapes import Model
from tests.decals.shapes import View
from tests.oracles.csg import deep_hits, signed_distance

TARGETS = {"csg_holes": "0", "csg_ray_holes": "0"}

DEPTH = 1e-4
"""How deep a ray must be inside, over the diagonal of the model's box."""

MAX_DEPTH = 4
"""Depth of the deepest trees."""

FAR = 0.5
"""Vertical angle of view of far cameras in degrees: the eye is 200 diagonals away."""

CLOSEST = 0.01
"""Least distance of a near eye from the solid, over the diagonal of the model's box."""

TREES, QUICK_TREES = 100, 12
SIZE, QUICK_SIZE = (160, 120), (60, 45)


@dataclass(frozen=True)
class Holes:
    """Pixels that must show the surface; those of them that do not, in a picture and among traced rays."""

    pixels: int
    of_picture: int
    of_rays: int


def measure(seed: int = 1, *, quick: bool) -> dict[str, float]:
    """Draw random trees that are not empty from random places, and count the holes."""
    found: list[Holes] = []
    with Renderer() as renderer:
        for case in count():
            holes = holes_of(*scene(seed, case), renderer, QUICK_SIZE if quick else SIZE)
            found += [holes] if holes.pixels else []
            if len(found) == (QUICK_TREES if quick else TREES):
                break
    return {
        "csg_holes": sum(holes.of_picture for holes in found),
        "csg_ray_holes": sum(holes.of_rays for holes in found),
        "csg_cases": len(found),
        "csg_pixels": sum(holes.pixels for holes in found),
    }


def scene(seed: int, case: int) -> tuple[Node, Camera]:
    """The tree and the camera of a case: every other tree is regular, and cameras are far or near in turn."""
    rng = np.random.default_rng([seed, case])
    tree = visible_tree(rng, 1 + case % MAX_DEPTH, regular=case // MAX_DEPTH % 2 == 1)
    place = case % 3
    if place == 2 and (camera := _near(rng, tree)):
        return tree, camera
    direction = rng.normal(size=3) if rng.random() < 0.7 else np.roll([1.0, 0.0, 0.0], rng.integers(3))
    fov = FAR if place == 1 else 30.0
    return tree, Camera.framing(tree.support, direction=direction.tolist(), fov=fov)


def _near(rng: np.random.Generator, tree: Node) -> Camera | None:
    """A wide camera in or beside the box of a tree, but not in or at its solid; None if none is found."""
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    diagonal = float(np.linalg.norm(upper - lower))
    for _ in range(100):
        eye, target = rng.uniform(lower - 0.1 * diagonal, upper + 0.1 * diagonal), rng.uniform(lower, upper)
        if signed_distance(tree, eye[None])[0] > CLOSEST * diagonal:
            return Camera(triple(eye), target=triple(target), fov=80.0)
    return None


def holes_of(
    tree: Node, camera: Camera, renderer: Renderer, size: tuple[int, int], *, twin: Node | None = None
) -> Holes:
    """Return the holes of a tree in a camera's view; pixels beside a silhouette do not count.

    `twin` has the same shape, of kinds that the oracle knows.
    """
    width, height = size
    x, y = np.meshgrid(np.arange(width) + 0.5, height - np.arange(height) - 0.5)
    rays = camera.rays(width, height)
    directions = rays.directions(x, y).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = np.broadcast_to(rays.origin, directions.shape)
    depth = DEPTH * float(np.linalg.norm(tree.support[1] - tree.support[0]))
    deep = deep_hits(twin or tree, origins, directions, depth)
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
