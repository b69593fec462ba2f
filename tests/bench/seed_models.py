"""Models over which seeds are measured. Meshes may come from a file, where they cannot be made."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from blobtree import Node, Point, polygonize
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface


def bumpy() -> Node:
    """Make a ball with twenty-four bumps."""
    ways = np.random.default_rng(0).normal(size=(24, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    tree: Node = Point((0, 0, 0), radius=1.0)
    for way in 0.95 * ways:
        tree = tree + Point(tuple(way), radius=0.3)
    return tree


TREES: dict[str, Callable[[], list[Node]]] = {
    "bumpy": lambda: [bumpy()],
    "sphere": lambda: [Point((0, 0, 0), radius=1.0)],
    "touching": lambda: [Point((-1, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)],
}

MESHES = ("knot", "dragon", "horse")

MODELS = (*TREES, *MESHES)


def mesh_arrays(name: str, file: Path | None = None):
    """Vertices and faces of a mesh, from the file if there is one; `UsageError` where it cannot be had."""
    if file is not None:
        with np.load(file) as held:
            return held[f"{name}_vertices"], held[f"{name}_faces"]
    from implicit_decals.apps.models.knot import torus_knot
    from implicit_decals.apps.models.samples import sample_mesh

    return torus_knot(along=1042) if name == "knot" else sample_mesh(name)


def write_meshes(file: Path) -> None:
    """Write the meshes to a file that `mesh_arrays` reads."""
    arrays = {}
    for name in MESHES:
        vertices, faces = mesh_arrays(name)
        arrays |= {f"{name}_vertices": vertices, f"{name}_faces": faces}
    np.savez_compressed(file, **arrays)


def meshed(tree: Node, device: str = "cpu") -> MeshSurface:
    mesh = polygonize(tree, resolution=160, device=device)
    return MeshSurface(mesh.vertices, mesh.faces, device=device)


def surfaces_of(name: str, device: str = "cpu", file: Path | None = None):
    """Surfaces of a model as seeds lie on them: trees themselves, not meshes of them."""
    if name in TREES:
        return [ImplicitSurface(tree, device=device) for tree in TREES[name]()]
    return [MeshSurface(*mesh_arrays(name, file), device=device)]
