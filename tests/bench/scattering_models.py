"""Models for the benchmarks of scattering. Meshes may come from a file, on machines that cannot make them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from blobtree import Node, Point, Sum, polygonize
from decals.surfaces import ImplicitSurface, MeshSurface
from tests.bench.blobtree import blobs


def bumpy() -> Node:
    """Return a ball with twenty-four bumps."""
    directions = np.random.default_rng(0).normal(size=(24, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    tree: Node = Point((0, 0, 0), radius=1.0)
    for direction in 0.95 * directions:
        tree = tree + Point(tuple(direction), radius=0.3)
    return tree


TREES: dict[str, Callable[[], list[Node]]] = {
    "bumpy": lambda: [bumpy()],
    "sphere": lambda: [Point((0, 0, 0), radius=1.0)],
    "balls": lambda: [Sum(blobs(1000))],
    "touching": lambda: [Point((-1, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)],
}

MESHES = ("knot", "dragon", "horse")

MODELS = (*TREES, *MESHES)


def mesh_arrays(name: str, file: Path | None = None) -> Any:
    """Return vertices and faces of a mesh, from a file if given; raise `InvalidInput` without it."""
    if file is not None:
        with np.load(file) as arrays:
            return arrays[f"{name}_vertices"], arrays[f"{name}_faces"]
    from decals.apps.models.samples import sample_mesh
    from decals.apps.models.shapes import torus_knot

    return torus_knot(along=1042) if name == "knot" else sample_mesh(name)


def write_meshes(file: Path) -> None:
    """Write the meshes to a file that `mesh_arrays` reads."""
    arrays: dict[str, Any] = {}
    for name in MESHES:
        vertices, faces = mesh_arrays(name)
        arrays |= {f"{name}_vertices": vertices, f"{name}_faces": faces}
    np.savez_compressed(file, **arrays)


def meshed(tree: Node, device: str = "cpu") -> MeshSurface:
    mesh = polygonize(tree, resolution=160, device=device)
    return MeshSurface(mesh.vertices, mesh.faces, device=device)


def surfaces_of(name: str, device: str = "cpu", file: Path | None = None) -> Any:
    """Return the surfaces of a model, for a tree the implicit surface itself."""
    if name in TREES:
        return [ImplicitSurface(tree, device=device) for tree in TREES[name]()]
    return [MeshSurface(*mesh_arrays(name, file), device=device)]
