"""Sample models by name: those of the paper (its figure 14), and the creature of the demo."""

import logging
import warnings
from collections.abc import Callable
from functools import partial

from blobtree import Node
from decals.scenes.mesh_file import MeshArrays, surface_triangles
from decals.scenes.object_records import SAMPLE
from decals.scenes.scene import MeshObject, SceneObject, TreeObject

from ..errors import UsageError
from ..views import UPRIGHT, Axes
from .creature import creature
from .knot import torus_knot
from .spheres import spheres

_DATA = "https://github.com/pyvista/vtk-data"


def _download(name: str) -> MeshArrays:
    """Get a mesh through pyvista: from its cache, from ``PYVISTA_DATA``, or from the internet."""
    logging.getLogger("pooch").setLevel(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about a PYVISTA_DATA that is no folder; what counts is the mesh
            from pyvista import examples  # it looks at PYVISTA_DATA when it is imported

            surface = getattr(examples, f"download_{name}")()
    except Exception as error:  # no network, no permission, a broken cache: all end here
        reason = type(error).__name__
        raise UsageError(
            f"the sample {name!r} is downloaded by pyvista on first use, and that failed ({reason}); "
            f"connect to the internet, or set PYVISTA_DATA to a copy of {_DATA}"
        ) from error
    return surface_triangles(surface, name=name)


_MESHES: dict[str, Callable[[], MeshArrays]] = {
    "dragon": partial(_download, "dragon"),
    "horse": partial(_download, "horse"),
    "knot": torus_knot,
}
_TREES: dict[str, Callable[[], Node]] = {"creature": creature, "spheres": spheres}

_AXES = {"horse": Axes(up=(0.0, 0.0, 1.0), front=(1.0, 0.0, 0.0))}

SAMPLES: tuple[str, ...] = tuple(sorted([*_MESHES, *_TREES]))
"""Names of the samples."""


def axes_of(model: str) -> Axes:
    """Which way a sample stands; other models stand along y."""
    return _AXES.get(model, UPRIGHT["y"])


def sample_mesh(name: str) -> MeshArrays:
    """Vertices and faces of a sample mesh; a `decals.scenes.object_records.SampleLoader`."""
    if name not in _MESHES:
        raise UsageError(f"expected a sample mesh ({', '.join(sorted(_MESHES))}), got {name!r}")
    return _MESHES[name]()


def sample(name: str) -> SceneObject:
    """Make or fetch a sample as an object of its own name.

    Raises
    ------
    UsageError
        If there is no such sample, or it had to be downloaded and could not.
    """
    if name in _TREES:
        return TreeObject(name, _TREES[name]())
    vertices, faces = sample_mesh(name)
    return MeshObject(name, vertices, faces, source=SAMPLE + name)
