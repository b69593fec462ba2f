"""Decals at arbitrary points, without graphics: for baking, experiments and tests."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from decals.checks import member, shown
from decals.errors import InvalidDecals, InvalidImage, InvalidPoints, InvalidScene
from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.field.sampling import color_points, sample_points
from decals.field.texels import RGBA, texel_arrays
from decals.grid.editor import RECORDS, DecalEditor
from decals.grid.index import DecalIndex, DeviceIndex
from decals.model import PLAIN, Decals
from decals.wishes import device_or_error


@dataclass(frozen=True, eq=False)
class Samples:
    """What decals show at m points.

    Attributes
    ----------
    owner : int32[m]
        Number of the topmost decal that shows at each point, −1 where none does.
    uv : float32[m, 2]
        Place in the owner's image, which is the disc of radius ½ around (½, ½); farther out the decal's rim
        along the surface is behind, and nothing is drawn. 0 where there is no owner.
    field : float32[m]
        F after contact (paper, equation 5): 1 at the centre, ½ on rims and contact lines; 0 without owner.
    color : float32[m, 4] or None
        Colour of all decals over each other, in linear light with premultiplied alpha; None without images.
    """

    owner: NDArray[np.int32]
    uv: NDArray[np.float32]
    field: NDArray[np.float32]
    color: NDArray[np.float32] | None = None


def evaluate(
    decals: Decals | DecalEditor,
    points: ArrayLike,
    normals: ArrayLike,
    *,
    mapping: Mapping = Mapping.CORRECTED,
    contact: Contact = Contact.PAPER,
    index: DecalIndex | None = None,
    images: Sequence[RGBA] | None = None,
    device: Any = None,
) -> Samples:
    """Find owner, image coordinates, field and colour of surface points.

    Parameters
    ----------
    decals : Decals or DecalEditor
        n decals; those of an editor are told by their numbers.
    points, normals : float32[m, 3]
        Surface points and the surface's geometric normals there, of any length; one of length 0 faces every
        decal. A point that is not finite has no owner.
    mapping : Mapping, optional
        How the images bend with the surface.
    contact : Contact, optional
        How contact decals push each other.
    index : DecalIndex, optional
        The index of these very decals; built where not given. An editor brings its own.
    images : sequence of uint8[h, w, 4], optional
        sRGB images with alpha, of any sizes; with them, colours are found too.
    device : optional
        Warp device; its default where not given.

    Raises
    ------
    InvalidPoints
        Points and normals are not two arrays of the same shape [m, 3].
    InvalidImage
        Something that is no image, or fewer images than decals show.
    InvalidDecals, InvalidScene, InvalidDevice
        Something that is no decals or an index of others, no mapping or contact, or no device of Warp's.
    """
    mapping = member("mapping", mapping, Mapping, InvalidScene)
    contact = member("contact", contact, Contact, InvalidScene)
    device = device_or_error(device)
    places, directions = _rows("points", points), _rows("normals", normals)
    if len(places) != len(directions):
        raise InvalidPoints(f"normals: expected one for each of {len(places)} points, got {len(directions)}")
    records, placed = _placed(decals, index, device)
    count = len(places)
    owner: Any = wp.zeros(count, dtype=wp.int32, device=device)
    uv: Any = wp.zeros(count, dtype=wp.vec2, device=device)
    field: Any = wp.zeros(count, dtype=wp.float32, device=device)
    inputs = [
        wp.array(places, dtype=wp.vec3, device=device),
        wp.array(directions, dtype=wp.vec3, device=device),
        int(mapping),
        int(contact),
        decals.layered,
        wp.array(records, dtype=wp.vec4, device=device, copy=False),
        *placed.arguments(),
    ]
    wp.launch(sample_points, count, inputs, [owner, uv, field], device=device)
    color = None if images is None else _colors(decals, images, [*inputs, owner], device)
    return Samples(owner.numpy(), uv.numpy(), field.numpy(), color)


def _placed(
    decals: Decals | DecalEditor, index: DecalIndex | None, device: Any
) -> tuple[NDArray[np.float32], DeviceIndex]:
    """Records and index of decals."""
    if isinstance(decals, DecalEditor):
        return decals.arrays[RECORDS], decals.index.on(device, copy=False)
    if not isinstance(decals, Decals):
        raise InvalidDecals(f"expected Decals or a DecalEditor, got {shown(decals)}; a scene has .decals")
    if index is None:
        return decals.packed(), DeviceIndex.of(decals, device)
    if not isinstance(index, DecalIndex) or index.count != len(decals):
        came = f"one of {index.count}" if isinstance(index, DecalIndex) else shown(index)
        raise InvalidDecals(
            f"index: expected the index of these {len(decals)} decals, got {came}; DecalIndex.of makes it"
        )
    return decals.packed(), index.on(device)


def _colors(
    decals: Decals | DecalEditor, images: Sequence[RGBA], inputs: list[Any], device: Any
) -> NDArray[np.float32]:
    shown = decals.decals if isinstance(decals, DecalEditor) else decals
    needed = int(shown.images.max(initial=PLAIN)) + 1
    if len(images) < needed:
        raise InvalidImage(
            f"images: expected {needed} or more, got {len(images)}; decals show them by number"
        )
    places, texels = texel_arrays(images)
    colors: Any = wp.zeros(len(inputs[0]), dtype=wp.vec4, device=device)
    arrays: list[Any] = [
        wp.array(places, dtype=wp.vec3i, device=device),
        wp.array(texels, dtype=wp.vec4, device=device),
    ]
    wp.launch(color_points, len(inputs[0]), [*inputs, *arrays], [colors], device=device)
    result: NDArray[np.float32] = colors.numpy()
    return result


def _rows(name: str, values: ArrayLike) -> NDArray[np.float32]:
    try:
        array = np.asarray(values, np.float32)
    except (TypeError, ValueError):
        raise InvalidPoints(f"{name}: expected numbers of shape [m, 3], got {shown(values)}") from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidPoints(f"{name}: expected shape [m, 3], got {list(array.shape)}; give one row per point")
    return array
