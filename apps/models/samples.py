"""Sample models by name: those of the paper's figure 14, and the creature of the demo."""

import logging
import warnings
from collections.abc import Callable
from functools import partial

from blobtree import Node
from blobtree.nodes.paths import Path
from decals import MeshObject, TreeObject
from decals.apps.models.shapes import CREATURE_PARTS, creature, spheres, torus_knot
from decals.errors import InvalidInput
from decals.scenes.camera import UPRIGHT, Axes
from decals.scenes.objects import SceneObject
from decals.scenes.records import SAMPLE
from decals.surfaces.mesh_file import dataset_triangles
from decals.surfaces.triangulate import MeshArrays

_DATA = "https://github.com/pyvista/vtk-data"


def _download(name: str) -> MeshArrays:
    """Return a mesh of pyvista's: from its cache, from ``PYVISTA_DATA``, or from the internet."""
    logging.getLogger("pooch").setLevel(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pyvista warns if PYVISTA_DATA is not a folder
            from pyvista import examples  # reads PYVISTA_DATA when imported

            surface = getattr(examples, f"download_{name}")()
    except Exception as error:  # no network, no permission, a broken cache, ...
        reason = type(error).__name__
        raise InvalidInput(
            f"the sample {name!r} is downloaded by pyvista on first use, and that failed ({reason}); "
            f"connect to the internet, or set PYVISTA_DATA to a copy of {_DATA}"
        ) from error
    return dataset_triangles(surface, name=name)


_MESHES: dict[str, Callable[[], MeshArrays]] = {
    "dragon": partial(_download, "dragon"),
    "horse": partial(_download, "horse"),
    "knot": torus_knot,
}
_TREES: dict[str, Callable[[], Node]] = {"creature": creature, "spheres": spheres}
_NAMES: dict[str, dict[Path, str]] = {
    "creature": {(place,): part for place, part in enumerate(CREATURE_PARTS)}
}
"""Names of nodes, by their paths."""

_AXES = {"horse": Axes(up=(0.0, 0.0, 1.0), front=(1.0, 0.0, 0.0))}

SAMPLES: tuple[str, ...] = tuple(sorted([*_MESHES, *_TREES]))
"""Names of the sample models."""


def axes_of(model: str) -> Axes:
    """Return the axes of a sample; for other models, y points upward."""
    return _AXES.get(model, UPRIGHT["y"])


def sample_mesh(name: str) -> MeshArrays:
    """Return the vertices and faces of a sample mesh; a `decals.scenes.records.SampleLoader`."""
    if name not in _MESHES:
        raise InvalidInput(f"expected a sample mesh ({', '.join(sorted(_MESHES))}), got {name!r}")
    return _MESHES[name]()


def sample(name: str) -> SceneObject:
    """Return a sample as an object of the same name.

    Raises
    ------
    InvalidInput
        If the sample does not exist or cannot be downloaded.
    """
    if name in _TREES:
        return TreeObject(name, _TREES[name](), names=_NAMES.get(name, {}))
    vertices, faces = sample_mesh(name)
    return MeshObject(name, vertices, faces, source=SAMPLE + name)
