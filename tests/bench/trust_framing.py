"""Framing: the share of a picture that models take, at many aspect ratios and angles of view."""

import numpy as np
from numpy.typing import NDArray

import blobtree
import decals
from decals import MeshObject, TreeObject
from decals.scenes.cover import fitting_camera
from decals.scenes.objects import SceneObject
from tests.decals.meshes import icosphere

TARGETS = {"framing_faults": "0"}
"""Targets of the counts; each stands beside its number of cases."""

MODELS, QUICK_MODELS = 100, 12
"""Models, and those of a quick run."""

ASPECTS = (1 / 3, 9 / 16, 1.0, 4 / 3, 3 / 2, 3.0)
"""Widths of the pictures over their heights."""

ANGLES = (10.0, 30.0, 60.0, 90.0)
"""Angles of view, in degrees."""

HEIGHT = 600
"""Height of the pictures, in pixels."""

LEAST, MOST = 0.8, 0.98
"""Shares of the width or the height, whichever the model fills first."""


def measure(seed: int = 1, *, quick: bool) -> dict[str, float]:
    """Count the pictures in which a model is cut, or fills another share than it should."""
    faults = cases = 0
    for number in range(QUICK_MODELS if quick else MODELS):
        rng = np.random.default_rng([seed, number])
        objects = random_objects(rng)
        direction = tuple(rng.normal(size=3).tolist())
        for fov in ANGLES:
            camera = fitting_camera(objects, direction=direction, fov=fov, aspect=None)
            for aspect in ASPECTS:
                cases += 1
                faults += not LEAST <= filled(camera, objects, aspect) <= MOST
    return {"framing_faults": faults, "framing_cases": cases}


def filled(camera: decals.Camera, objects: list[SceneObject], aspect: float) -> float:
    """Return the share of the picture that objects take; 2 if they are cut."""
    size = (round(HEIGHT * aspect), HEIGHT)
    points = np.concatenate([points_of(item) for item in objects])
    matrix = camera.clip_matrix(size, (points.min(axis=0), points.max(axis=0)))
    clip = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    if (clip[:, 3] <= 0.0).any():
        return 2.0
    places = clip[:, :2] / clip[:, 3:]
    return 2.0 if np.abs(places).max() > 1.0 else float(np.ptp(places, axis=0).max() / 2.0)


def points_of(item: SceneObject) -> NDArray[np.float64]:
    """Return points of the surface of an object, its tips among them."""
    if isinstance(item, MeshObject):
        return item.vertices[np.unique(item.faces)].astype(np.float64)
    return blobtree.polygonize(item.tree, resolution=96).vertices.astype(np.float64)


def random_objects(rng: np.random.Generator) -> list[SceneObject]:
    """Return a model of one or two parts: a star, a rod, a plate, a far pair, or a tree.

    No tip is so sharp that all of the model lies in the cone that an eye at the tip sees.
    """
    kind, scale = rng.integers(5), float(10.0 ** rng.uniform(-3, 3))
    shift = scale * rng.normal(size=3)
    if kind == 0:
        ends = scale * rng.normal(size=(6, 3))
        tree = blobtree.Sum(
            [
                blobtree.Segment(tuple(a), tuple(b), radius=float(scale * rng.uniform(0.05, 0.4)))
                for a, b in zip(ends[:3], ends[3:], strict=True)
            ]
        )
        return [TreeObject("tree", tree)]
    vertices, faces = icosphere(3)
    if kind == 1:
        spikes = rng.random(len(vertices)) < 0.02
        vertices = vertices * np.where(spikes, rng.uniform(1.0, 1.4, len(vertices)), 1.0)[:, None]
    elif kind == 2:
        lengthened = vertices + np.sign(vertices) * (0.0, 0.0, 1.0 / rng.uniform(0.02, 0.5))
        vertices = lengthened @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    elif kind == 3:
        vertices = vertices * (1.0, 0.001, 1.0) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    else:
        other = 0.1 * vertices + 5.0 * rng.normal(size=3)
        vertices, faces = np.concatenate([vertices, other]), np.concatenate([faces, faces + len(vertices)])
    unused = np.full((1, 3), 50.0)  # a vertex of no face
    return [MeshObject("mesh", np.concatenate([scale * vertices + shift, scale * unused]), faces)]
