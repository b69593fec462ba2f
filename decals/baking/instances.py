"""Decals as copies of a square, for programs that have decals of their own (EXT_mesh_gpu_instancing)."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, UInt8Array
from decals.images.load import HasPixels
from decals.images.texels import as_bytes, decode_srgb
from decals.model import Decals

EXTENSION = "EXT_mesh_gpu_instancing"

PLAIN_SIZE = 64
"""Texels along each side of the white disc of decals without image."""

SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
"""Corners of a decal of radius 1, whose image's u axis is x and whose normal is z."""

SQUARE_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)

_KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


@dataclass(frozen=True, eq=False)
class Instances:
    """The decals that show one image.

    Attributes
    ----------
    name : str
        Name of the node.
    picture : uint8[h, w, 4]
        The image, transparent outside of its rim.
    attributes : mapping of str to float32 array
        Values of each decal, by the names of the extension.
    """

    name: str
    picture: UInt8Array
    attributes: Mapping[str, Float32Array]


def decal_instances(decals: Decals, images: Sequence[HasPixels], taken: Collection[str]) -> list[Instances]:
    """Return the decals by their images, under other names than those that are taken."""
    found = []
    for number in np.unique(decals.images).tolist():
        rows = np.flatnonzero(decals.images == number)
        image = images[number].pixels if number >= 0 else np.full((PLAIN_SIZE, PLAIN_SIZE, 4), 255, np.uint8)
        name = f"decals {number}: {getattr(images[number], 'source', '')}" if number >= 0 else "plain decals"
        while name in taken:
            name += "-"
        found.append(Instances(name, _masked(as_bytes(image)), _attributes(decals, rows)))
    return found


def _masked(pixels: UInt8Array) -> UInt8Array:
    """Return an image that is transparent outside of the ellipse that touches its edges."""
    height, width = pixels.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    outside = ((2 * x + 1) / width - 1) ** 2 + ((2 * y + 1) / height - 1) ** 2 > 1.0
    masked = pixels.copy()
    masked[outside, 3] = 0
    return masked


def _attributes(decals: Decals, rows: NDArray[np.integer[Any]]) -> dict[str, Float32Array]:
    """Return places and looks of some decals."""
    normals, tangents = decals.normals[rows].astype(np.float64), decals.tangents[rows].astype(np.float64)
    frames = np.stack([tangents, np.cross(normals, tangents), normals], axis=2)
    columns: dict[str, NDArray[Any]] = {
        "TRANSLATION": decals.positions[rows],
        "ROTATION": quaternions(frames),
        "SCALE": np.repeat(decals.radii[rows, None], 3, axis=1),
        "_COLOR_0": decode_srgb(decals.tints[rows].astype(np.float64)),
        "_OPACITY": decals.opacities[rows],
        "_DECAL": rows,
        "_LAYER": decals.layers[rows],
    }
    return {name: np.ascontiguousarray(column, np.float32) for name, column in columns.items()}


def quaternions(frames: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit quaternions (x, y, z, w) of rotations ``float64[n, 3, 3]``."""
    from scipy.spatial.transform import Rotation  # imported where it is used: it takes a tenth of a second

    found: NDArray[np.float64] = Rotation.from_matrix(frames).as_quat()
    return found


def add_instances(buffers: dict[Any, bytes], tree: dict[str, Any], *, instances: Sequence[Instances]) -> None:
    """Let nodes of a glTF document of trimesh be drawn once for each decal.

    Parameters
    ----------
    buffers
        Contents of the document's buffer views.
    tree
        The document, in which accessors have keys yet.
    instances
        The decals of each image.
    """
    nodes = {node.get("name"): node for node in tree["nodes"]}
    for group in instances:
        numbers = {}
        for name, column in group.attributes.items():
            numbers[name] = len(tree["accessors"])
            tree["accessors"][EXTENSION, group.name, name] = {
                "bufferView": len(buffers),
                "componentType": 5126,
                "count": len(column),
                "type": _KINDS[column[0].size],
            }
            buffers[EXTENSION, group.name, name] = column.tobytes()
        nodes[group.name].setdefault("extensions", {})[EXTENSION] = {"attributes": numbers}
    if instances:
        tree["extensionsUsed"] = [*tree.get("extensionsUsed", ()), EXTENSION]
