"""Decals at arbitrary points, without graphics: for baking, experiments and tests."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from decals.errors import InvalidPoints
from decals.index import DecalIndex
from decals.mapping import Mapping
from decals.model import Decals
from decals.ownership import sample_points


@dataclass(frozen=True, eq=False)
class Samples:
    """What decals show at m points.

    Attributes
    ----------
    owner : int32[m]
        Number of the decal that owns each point, −1 where none does.
    uv : float32[m, 2]
        Place in the owner's image, in [0, 1]² with ½ at its centre; 0 where there is no owner.
    field : float32[m]
        F after contact (paper, equation 5): 1 at the centre, ½ on rims and contact lines; 0 without owner.
    """

    owner: NDArray[np.int32]
    uv: NDArray[np.float32]
    field: NDArray[np.float32]


def evaluate(
    decals: Decals,
    points: ArrayLike,
    normals: ArrayLike,
    *,
    mapping: Mapping = Mapping.CORRECTED,
    index: DecalIndex | None = None,
    device: Any = None,
) -> Samples:
    """Find owner, image coordinates and field of surface points.

    Parameters
    ----------
    decals : Decals
        n decals.
    points, normals : float32[m, 3]
        Surface points and the surface's geometric normals there, of any length. A point that is not finite
        has no owner.
    mapping : Mapping, optional
        How the images bend with the surface.
    index : DecalIndex, optional
        The index of these very decals; built where not given.
    device : optional
        Warp device; its default where not given.

    Raises
    ------
    InvalidPoints
        Points and normals are not two arrays of the same shape [m, 3].
    """
    places, directions = _rows("points", points), _rows("normals", normals)
    if len(places) != len(directions):
        raise InvalidPoints(f"normals: expected one for each of {len(places)} points, got {len(directions)}")
    if index is None:
        index = DecalIndex.build(decals.positions, decals.influence)
    count = len(places)
    owner: Any = wp.zeros(count, dtype=wp.int32, device=device)
    uv: Any = wp.zeros(count, dtype=wp.vec2, device=device)
    field: Any = wp.zeros(count, dtype=wp.float32, device=device)
    inputs = [
        wp.array(places, dtype=wp.vec3, device=device),
        wp.array(directions, dtype=wp.vec3, device=device),
        int(mapping),
        wp.array(decals.packed(), dtype=wp.vec4, device=device),
        *index.on(device).arguments(),
    ]
    wp.launch(sample_points, count, inputs, [owner, uv, field], device=device)
    return Samples(owner.numpy(), uv.numpy(), field.numpy())


def _rows(name: str, values: ArrayLike) -> NDArray[np.float32]:
    array = np.asarray(values, np.float32)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidPoints(f"{name}: expected shape [m, 3], got {list(array.shape)}; give one row per point")
    return array
