"""Python packages that sample points on a mesh, each in its best use, if it is installed."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Package:
    """A package's sampler: ``sample(vertices, faces, count) -> points``, about `count` of them."""

    title: str
    version: str
    sample: Callable[[Any, Any, int], Any]


def _pymeshlab(module: Any) -> Callable[[Any, Any, int], Any]:
    def sample(vertices: Any, faces: Any, count: int) -> Any:
        meshes = module.MeshSet()
        meshes.add_mesh(module.Mesh(vertices, faces))
        meshes.generate_sampling_poisson_disk(samplenum=count, exactnumflag=True)
        return meshes.current_mesh().vertex_matrix()

    return sample


def _open3d(module: Any) -> Callable[[Any, Any, int], Any]:
    def sample(vertices: Any, faces: Any, count: int) -> Any:
        mesh = module.geometry.TriangleMesh(
            module.utility.Vector3dVector(vertices), module.utility.Vector3iVector(faces)
        )
        return np.asarray(mesh.sample_points_poisson_disk(count).points)

    return sample


def _poisson(module: Any) -> Callable[[Any, Any, int], Any]:
    def sample(vertices: Any, faces: Any, count: int) -> Any:
        found, weights = module.sample_mesh_poisson_disk(vertices, faces, count, random_seed=1)
        return np.einsum("nk,nkj->nj", weights, vertices[faces[found]])

    return sample


def _lloyd(module: Any) -> Callable[[Any, Any, int], Any]:
    return lambda vertices, faces, count: module.sample_mesh_lloyd(vertices, faces, count)


def _trimesh(module: Any) -> Callable[[Any, Any, int], Any]:
    def sample(vertices: Any, faces: Any, count: int) -> Any:
        mesh = module.Trimesh(vertices, faces, process=False)
        return module.sample.sample_surface_even(mesh, count, seed=1)[0]

    return sample


def _libigl(module: Any) -> Callable[[Any, Any, int], Any]:
    def sample(vertices: Any, faces: Any, count: int) -> Any:
        corners = vertices[faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        radius = 0.752 * np.sqrt(0.5 * area.sum() * 2 / (np.sqrt(3) * count))  # fills to about the count
        return module.blue_noise(vertices, faces.astype(np.int64), radius)[2]

    return sample


def _finder(
    title: str, module: str, distribution: str, make: Callable[[Any], Callable[[Any, Any, int], Any]]
) -> Callable[[], Package | None]:
    def find() -> Package | None:
        try:
            return Package(title, version(distribution), make(import_module(module)))
        except (ImportError, PackageNotFoundError, OSError):
            return None

    return find


PACKAGES: dict[str, Callable[[], Package | None]] = {
    "pymeshlab": _finder("pymeshlab, Poisson disks", "pymeshlab", "pymeshlab", _pymeshlab),
    "open3d": _finder("open3d, Poisson disks", "open3d", "open3d", _open3d),
    "point-cloud-utils": _finder(
        "point-cloud-utils, Poisson", "point_cloud_utils", "point-cloud-utils", _poisson
    ),
    "point-cloud-utils (Lloyd)": _finder(
        "point-cloud-utils, Lloyd", "point_cloud_utils", "point-cloud-utils", _lloyd
    ),
    "trimesh": _finder("trimesh, even", "trimesh", "trimesh", _trimesh),
    "libigl": _finder("libigl, blue noise", "igl", "libigl", _libigl),
}
"""A function for each package that returns it, or None if it is not installed."""
