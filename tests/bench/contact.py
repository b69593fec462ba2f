"""Figures of contact between solids: gaps, overlaps, jumps of normals and errors of volumes.

    python -m tests.bench.contact

The model is three blobs of different stiffness that touch each other; values come from float64 oracles where
the figure is about the mathematics, and from the kernels where it is about the product.
"""

import argparse

import numpy as np

from blobtree import ISO, Ellipsoid, Node, Point, Segment, SolidContact, polygonize
from blobtree._typing import Float64Array
from blobtree.meshing.clip import enclosed_volume
from tests.oracles import blobtree as oracle

SAMPLES = 1_000_000
EDGE_SAMPLES = 10_000
STEP = 1e-4
"""Distance on each side of an edge at which normals are compared, in model units."""


def solids() -> tuple[Node, Node, Node]:
    """Three blobs, each of which reaches into both others."""
    return (
        Point((0.7, 0, 0), radius=0.9),
        Segment((-0.4, 0.6, 0), (-0.4, 0.6, 0.8), radius=0.8),
        Ellipsoid((-0.4, -0.65, 0), (0.9, 0.8, 0.7)),
    )


def figures(*, quick: bool = False) -> dict[str, float]:
    """Return the figures by their names.

    `pcm_gap`: largest |f₁ − f₂| on the contact surfaces of solids of equal stiffness. `pcm_penetrating`:
    samples inside two deformed solids. `pcm_voids`: samples inside solids, but inside no deformed one.
    `pcm_normal_jump`: largest angle in degrees between normals on both sides of a bulge's edges.
    `pcm_volume_error`: largest relative error of a volume after compensation.
    """
    count = SAMPLES // 10 if quick else SAMPLES
    equal = SolidContact(solids(), height=0.06)
    rated = SolidContact(solids(), stiffness=(1, 2, 4), height=0.06)
    penetrating, voids = _overlaps(rated, count)
    return {
        "pcm_gap": _gap(equal),
        "pcm_penetrating": penetrating,
        "pcm_voids": voids,
        "pcm_normal_jump": _normal_jump(EDGE_SAMPLES // 10 if quick else EDGE_SAMPLES),
        "pcm_volume_error": max(_volume_error(model.compensated()) for model in (equal, rated)),
    }


def _gap(model: SolidContact) -> float:
    """Largest |f₁ − f₂|, by the kernels, at vertices of the contact surfaces."""
    gaps: list[float] = []
    for number, solid in enumerate(model.solids()):
        vertices = polygonize(solid, resolution=64).vertices
        own = model.operands[number](vertices)
        other = np.max([node(vertices) for i, node in enumerate(model.operands) if i != number], axis=0)
        gaps.append(float(np.abs(own - other)[other > ISO].max()))
    return max(gaps)


def _overlaps(model: SolidContact, count: int) -> tuple[float, float]:
    """Numbers of samples inside two solids, and of samples inside solids that no deformed solid holds."""
    lower, upper = model.support
    points = np.random.default_rng(0).uniform(lower, upper, (count, 3)).astype(np.float32)
    inside = np.sum([solid(points) > ISO for solid in model.solids()], axis=0)
    before = np.any([solid(points) > ISO + 1e-6 for solid in model.operands], axis=0)
    return float((inside > 1).sum()), float((before & (inside == 0)).sum())


def _normal_jump(count: int) -> float:
    """Largest angle between normals beside the edges where contact begins and where the bulge ends."""
    height, width = 0.05, 0.3
    other = Point((0.8, 0, 0), radius=1.0)
    left = SolidContact((Point((-0.8, 0, 0), radius=1.0), other), height=height, width=width).solids()[0]
    rng, worst = np.random.default_rng(0), 0.0
    for level in (ISO, ISO - 2.0 * height, ISO - width):
        angles = rng.uniform(0.0, 2.0 * np.pi, count)
        around = np.stack([np.zeros(count), np.cos(angles), np.sin(angles)], axis=1)
        along, aside = _edge(left, other, level)
        points = along * np.array([1.0, 0.0, 0.0]) + aside * around
        normals = oracle.gradient(left, points[:1]) @ np.stack([[1.0, 0, 0], around[0]], axis=1)
        tangent = np.array([-normals[0, 1], normals[0, 0]]) / np.linalg.norm(normals[0])
        step = STEP * (tangent[0] * np.array([1.0, 0.0, 0.0]) + tangent[1] * around)
        sides = [left.gradient(points + sign * step).astype(np.float64) for sign in (-1.0, 1.0)]
        cosines = np.einsum("ni,ni->n", *sides) / np.prod([np.linalg.norm(s, axis=1) for s in sides], axis=0)
        worst = max(worst, float(np.degrees(np.arccos(np.minimum(cosines, 1.0))).max()))
    return worst


def _edge(solid: Node, other: Node, level: float) -> tuple[float, float]:
    """Distances along x and from the x axis of the circle where the solid's surface meets a level set."""
    place = np.array([[0.0, 0.7, 0.0]])
    for _ in range(60):
        values = np.array([oracle.value(solid, place)[0] - ISO, oracle.value(other, place)[0] - level])
        slopes: Float64Array = np.array([oracle.gradient(node, place)[0, :2] for node in (solid, other)])
        place[0, :2] -= 0.7 * np.linalg.solve(slopes, values)
    return float(place[0, 0]), float(place[0, 1])


def _volume_error(model: SolidContact) -> float:
    """Largest relative error of a solid's volume, in finer cells than those of the compensation."""
    errors: list[float] = []
    for solid, free in zip(model.solids(), model.operands, strict=True):
        meshes = (polygonize(node, cell_size=0.025) for node in (solid, free))
        volumes = [enclosed_volume(mesh.vertices, mesh.faces) for mesh in meshes]
        errors.append(abs(volumes[0] / volumes[1] - 1.0))
    return max(errors)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    for name, value in figures(quick=parser.parse_args().quick).items():
        print(f"{name:20} {value:.3g}")
