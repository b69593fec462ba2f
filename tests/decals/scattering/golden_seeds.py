"""What some seeds give: decals of a fixed list of scenes, as `tests/golden/seeds.json` has them.

    python -m tests.decals.scattering.golden_seeds          # compare with the file, also if disturbed
    python -m tests.decals.scattering.golden_seeds --write  # write the file

A seed's result is a promise to users: if it changes, write the change into the changelog, section "Seeds",
and write the file again. Positions settle in minima of an energy, so rounding of another processor moves
them far less than `TOLERANCE`; a case is fit for the list if a disturbed surface gives the same.
"""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import decals
from blobtree import Box, Point, Segment, polygonize
from decals import Decals
from decals.surfaces import MeshSurface

FILE = Path(__file__).resolve().parents[2] / "golden" / "seeds.json"

TOLERANCE = 0.02
"""Largest distance of a position or a tangent from the one in the file, in radii of its decal."""

DISTURBANCE = 1e-6
"""Relative change of the vertices of a mesh, some times the rounding of float32."""

BALL = Point((0, 0, 0), radius=1.0)
BLEND = BALL + Segment((0, 0, 0), (2, 0, 0), radius=0.5)
BOX = Box((0, 0, 0), (1, 1, 1), radius=0.2)
CAPSULE = Segment((0, 0, 0), (1, 0, 0), radius=0.5)


def capsule(disturbance: float) -> MeshSurface:
    """Return a mesh whose vertices are moved a little."""
    mesh = polygonize(CAPSULE, resolution=10)
    factors = 1.0 + np.random.default_rng(0).uniform(-disturbance, disturbance, mesh.vertices.shape)
    return MeshSurface(mesh.vertices * factors, mesh.faces)


CASES: dict[str, Callable[[float], Decals]] = {
    "ball": lambda d: decals.scatter(BALL.scale(1.0 + d), count=16, seed=0),
    "ball, seed 7": lambda d: decals.scatter(BALL.scale(1.0 + d), count=16, seed=7),
    "blend by spacing": lambda d: decals.scatter(BLEND.scale(1.0 + d), spacing=0.9, seed=1),
    "box": lambda d: decals.scatter(BOX.scale(1.0 + d), count=16, seed=5),
    "random places and images": lambda d: decals.scatter(
        BALL.scale(1.0 + d), count=10, images=3, regularity=0.0, seed=4
    ),
    "random places on a mesh": lambda d: decals.scatter(capsule(d), count=10, regularity=0.0, seed=4),
}
"""Functions of the disturbance that scatter some decals."""


def recorded(found: Decals) -> dict[str, Any]:
    """Return what the file keeps of decals."""
    rows = {name: getattr(found, name).round(5).tolist() for name in ("positions", "tangents", "radii")}
    return rows | {"images": found.images.tolist()}


def distances(found: Decals, kept: dict[str, Any]) -> NDArray[np.float64]:
    """Return how far each decal is from the kept one, in its radii; infinity for another number or image."""
    if found.images.tolist() != kept["images"]:
        return np.full(len(found), np.inf)
    radii = np.asarray(kept["radii"])
    moved = np.linalg.norm(found.positions - np.asarray(kept["positions"]), axis=1) / radii
    turned = np.linalg.norm(found.tangents - np.asarray(kept["tangents"]), axis=1)
    grown = np.abs(found.radii - radii) / radii
    worst: NDArray[np.float64] = np.max([moved, turned, grown], axis=0)
    return worst


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the file")
    if parser.parse_args().write:
        lines = [f"  {json.dumps(name)}: {json.dumps(recorded(make(0.0)))}" for name, make in CASES.items()]
        FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    for name, make in CASES.items():
        plain, disturbed = (distances(make(d), kept[name]).max() for d in (0.0, DISTURBANCE))
        print(f"{name:20} {plain:.2g} radii, disturbed {disturbed:.2g}")


if __name__ == "__main__":
    main()
