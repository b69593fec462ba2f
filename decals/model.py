"""Decals as data: a frozen, validated structure of arrays (paper, section 3.1)."""

from collections.abc import Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, fields, replace
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree.formulas.kernels import RIM
from decals.columns import (
    Bools,
    Ints,
    check_range,
    chosen_rows,
    flags,
    floats,
    orthogonal,
    shares,
    unit,
    whole,
)

FACING_LIMIT = -0.25
"""Smallest cosine between a decal's normal and that of the surface it colours, unless it spills."""

LARGEST = 2.0**50
"""Largest coordinate or radius, about 1e15: its square still fits float32."""

SMALLEST_RADIUS = 2.0**-50
"""Smallest radius, about 1e-15: its square is still a normal float32."""

LAYERS = 2**19
"""Layers run from -LAYERS to LAYERS - 1."""

PLAIN = -1
"""Image of a decal that shows its tint alone."""

RECORD = 4
"""Rows of the packed record of a decal."""

DEFAULT_RANK = 4 * LAYERS + 1
"""Rank of a contact decal of layer 0."""

MOST_IMAGES = 2**24
"""Images that there may be: the packed record carries an image's number as a float32."""

Floats = NDArray[np.float32]


class Interaction(IntEnum):
    """What a decal does to the others of its layer (paper, sections 1 and 3.2), from the lowest up.

    In every layer the contact decals together are one sheet: at each point the one of highest field shows,
    deformed so that it touches its neighbours. Independent decals lie under the sheet of their layer,
    overlapping ones over it; both are drawn whole, push nobody and are pushed by nobody.
    """

    INDEPENDENT = 0
    """Undeformed, overlapped by the contact decals of its layer."""
    CONTACT = 1
    """Jostles with the other contact decals of its layer."""
    OVERLAP = 2
    """Undeformed, drawn over the contact decals of its layer: eyes on scales."""


@dataclass(frozen=True, eq=False, repr=False)
class Decals:
    """n decals, one row each; arrays are checked, copied and read-only.

    Each decal is a point primitive and a tangent frame (paper, section 3.1 and figure 1). Normals and
    tangents may come in any length. A tangent that is not perpendicular to its normal is projected onto
    the tangent plane (Gram-Schmidt); frames that are orthonormal within rounding are kept bit for bit.

    Parameters
    ----------
    positions : float32[n, 3]
        Centres, in the model's units.
    normals : float32[n, 3]
        Surface normal at each centre.
    tangents : float32[n, 3]
        Direction of the image's u axis; the v axis is normal × tangent.
    radii : float32[n]
        Visible radius of an undisturbed decal: where its rim lies.
    images : int32[n], optional
        Index into the scene's list of images, or PLAIN (-1) for the tint alone. Default 0.
    spill : bool[n], optional
        Whether a decal also colours surface that faces away from it, such as the far side of a thin wall.
    interactions : int32[n], optional
        An `Interaction` each. Default CONTACT.
    layers : int32[n], optional
        Layers are drawn from the lowest up, decals of equal rank in the order of their numbers. Default 0.
    tints : float32[n, 3], optional
        sRGB colour by which the image is multiplied (in linear light), or of a plain decal. Default white.
    opacities : float32[n], optional
        From 0, unseen, to 1, the default.

    Raises
    ------
    InvalidDecals
        For wrong shapes, NaN or infinity, coordinates beyond LARGEST, radii outside SMALLEST_RADIUS to
        LARGEST, zero normals or tangents, a tangent along its normal, or images, interactions, layers, tints
        or opacities out of range.
    """

    positions: Floats
    normals: Floats
    tangents: Floats
    radii: Floats
    _: KW_ONLY
    images: Ints = None  # type: ignore[assignment]  # filled in by __post_init__
    spill: Bools = None  # type: ignore[assignment]  # filled in by __post_init__
    interactions: Ints = None  # type: ignore[assignment]  # filled in by __post_init__
    layers: Ints = None  # type: ignore[assignment]  # filled in by __post_init__
    tints: Floats = None  # type: ignore[assignment]  # filled in by __post_init__
    opacities: Floats = None  # type: ignore[assignment]  # filled in by __post_init__

    def __post_init__(self) -> None:
        positions = floats("positions", self.positions, (-1, 3))
        count = len(positions)
        normals = floats("normals", self.normals, (count, 3))
        tangents = floats("tangents", self.tangents, (count, 3))
        radii = floats("radii", self.radii, (count,))
        check_range("radii", radii, SMALLEST_RADIUS, LARGEST)
        check_range("positions", positions, -LARGEST, LARGEST)
        normals = unit("normals", normals)
        arrays = {
            "positions": positions.astype(np.float32),
            "normals": normals.astype(np.float32),
            "tangents": orthogonal(unit("tangents", tangents), normals).astype(np.float32),
            "radii": radii.astype(np.float32),
            "images": whole("images", self.images, count, low=PLAIN, high=MOST_IMAGES - 1, default=0),
            "spill": flags("spill", self.spill, count),
            "interactions": whole(
                "interactions", self.interactions, count, low=0, high=2, default=Interaction.CONTACT
            ),
            "layers": whole("layers", self.layers, count, low=-LAYERS, high=LAYERS - 1, default=0),
            "tints": shares("tints", self.tints, (count, 3)).astype(np.float32),
            "opacities": shares("opacities", self.opacities, (count,)).astype(np.float32),
        }
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def empty(cls) -> Self:
        """No decals at all."""
        none = np.zeros((0, 3), np.float32)
        return cls(positions=none, normals=none, tangents=none, radii=none[:, 0])

    @classmethod
    def concatenate(cls, parts: Iterable["Decals"]) -> Self:
        """All decals of all parts, in their order."""
        sources = [cls.empty(), *parts]
        return cls.of_rows({name: np.concatenate([getattr(p, name) for p in sources]) for name in _FIELDS})

    @classmethod
    def of_rows(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Decals whose arrays are rows of other decals', under the same names: nothing is checked again."""
        made = cls.__new__(cls)
        for name in _FIELDS:
            arrays[name].flags.writeable = False
            object.__setattr__(made, name, arrays[name])
        return made

    def replace(self, **arrays: ArrayLike) -> Self:
        """Exchange some arrays; the result is checked again."""
        return replace(self, **arrays)  # type: ignore[arg-type]  # any array-like is converted

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        """How many, and how large: thousands of rows would bury a notebook."""
        if len(self) == 0:
            return "Decals(0)"
        return f"Decals({len(self)}, radii from {self.radii.min():.3g} to {self.radii.max():.3g})"

    def __getitem__(self, rows: slice | ArrayLike) -> Self:
        """Pick some of the decals by a slice, a mask or an array of indices."""
        chosen = rows if isinstance(rows, slice) else np.atleast_1d(chosen_rows(rows))
        arrays = {name: getattr(self, name)[chosen] for name in _FIELDS}
        return type(self).of_rows(arrays) if arrays["radii"].ndim == 1 else type(self)(**arrays)

    @property
    def bitangents(self) -> Floats:
        """Direction of each image's v axis, n × u: float32[n, 3]."""
        return np.cross(self.normals, self.tangents)

    @property
    def influence(self) -> Floats:
        """Radius s at which each decal's field ends (paper, figure 1): float32[n], radii / 0.454202."""
        return (self.radii / np.float64(RIM)).astype(np.float32)

    @property
    def ranks(self) -> Ints:
        """Place of each decal's sheet or own drawing in the stack, from the lowest up: int32[n].

        Decals of one rank are drawn in the order of their numbers, save contact decals, which share a sheet.
        """
        return (self.layers + LAYERS) * 4 + self.interactions

    @property
    def layered(self) -> bool:
        """Whether decals lie over each other: they are not all contact decals of one layer."""
        return bool(
            (self.interactions != Interaction.CONTACT).any() or (self.layers != self.layers[:1]).any()
        )

    def packed(self) -> Floats:
        """Lay out the record that devices read: float32[4n, 4], RECORD rows a decal.

        Rows are (position, s), (normal, rank), (tangent, image) and (tint in linear light, opacity). The rank
        of a decal that spills is a half more: decals/field/ownership.py reads both.
        """
        record = np.empty((len(self), RECORD, 4), np.float32)
        record[:, 0, :3] = self.positions
        record[:, 0, 3] = self.influence
        record[:, 1, :3] = self.normals
        record[:, 1, 3] = self.ranks + np.where(self.spill, 0.5, 0.0)
        record[:, 2, :3] = self.tangents
        record[:, 2, 3] = self.images
        record[:, 3, :3] = linear_light(self.tints)
        record[:, 3, 3] = self.opacities
        return record.reshape(-1, 4)


def linear_light(colors: Floats) -> Floats:
    """Decode sRGB colours from 0 to 1."""
    wide = colors.astype(np.float64)
    return np.where(wide <= 0.04045, wide / 12.92, ((wide + 0.055) / 1.055) ** 2.4).astype(np.float32)


_FIELDS = tuple(field.name for field in fields(Decals))
