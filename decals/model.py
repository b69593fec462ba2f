"""`Decals`: decals as data, a frozen and validated structure of arrays (paper, section 3.1)."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, fields, replace
from enum import IntEnum
from functools import cached_property, partial
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import BoolArray, Float32Array, Int32Array
from blobtree.colors import Rgb
from blobtree.formulas.falloff import RIM
from blobtree.identity import Value
from blobtree.validation import describe, items
from decals.errors import InvalidDecals, InvalidRow
from decals.images.texels import decode_srgb
from decals.options import Values
from decals.receivers import TEXT, codes_of, receiver_array
from decals.validation import (
    bool_array,
    check_range,
    color_array,
    finite_array,
    instance,
    member_array,
    one_or_each,
    orthogonal_vectors,
    row_selection,
    unit_interval,
    unit_vectors,
    whole_array,
)

FACING_LIMIT = -0.25
"""Smallest cosine between the normals of a decal and of the surface that it colours, unless it spills."""

SHEET_HEIGHT = 0.15
"""Height of a surface point above the tangent plane of a decal, and of the decal below that of the point, or
the reverse, from which the two lie on different sheets: the root of their product, in visible radii."""

MAX_COORDINATE = 2.0**50
"""Largest coordinate or radius, about 1e15: its square still fits float32."""

MIN_RADIUS = 2.0**-50
"""Smallest radius, about 1e-15: its square is still a normal float32."""

LAYER_LIMIT = 2**19
"""Layers are numbered from -LAYER_LIMIT to LAYER_LIMIT - 1."""

NO_IMAGE = -1
"""Image number of a decal that shows only its tint."""

FADE_ANGLES = 1.0, 180.0
"""Least and greatest fade angle, in degrees."""

FADE_DEPTHS = 1e-6, 1e6
"""Least and greatest fade depth, in radii."""

RECORD = 4
"""Rows of the packed record of a decal."""

DEFAULT_RANK = 4 * LAYER_LIMIT + 1
"""Rank of a contact decal of layer 0."""

MAX_IMAGES = 2**24
"""Largest number of images: a packed record holds an image number as a float32."""


class Interaction(IntEnum):
    """Interaction of a decal with the others of its layer (paper, sections 1 and 3.2), in draw order.

    The decals of a layer that push each other are called contact decals. At each point, the contact decal of
    highest field shows, deformed so that it touches its neighbours. Independent decals are drawn below the
    contact decals of their layer, overlapping decals above them. Both are undeformed and push no other decal.

    Examples
    --------
    >>> import decals
    >>> list(decals.Interaction)
    [<Interaction.INDEPENDENT: 0>, <Interaction.PUSH: 1>, <Interaction.OVERLAP: 2>]
    """

    INDEPENDENT = 0
    """Undeformed, drawn below the contact decals of its layer."""
    PUSH = 1
    """Pushes, and is pushed by, the other contact decals of its layer."""
    OVERLAP = 2
    """Undeformed, drawn above the contact decals of its layer, such as eyes on scales."""


@dataclass(frozen=True, eq=False, repr=False)
class Decals(Value):
    """n decals, one row each. Arrays are checked, copied and read-only.

    Each decal is a point primitive and a tangent frame (paper, section 3.1 and figure 1). Normals and
    tangents may have any length. A tangent that is not perpendicular to its normal is projected onto the
    tangent plane (Gram-Schmidt). Frames that are orthonormal within rounding are kept bit for bit.

    Parameters
    ----------
    positions : float32[n, 3]
        Centres, in the model's units.
    normals : float32[n, 3]
        Surface normal at each centre.
    tangents : float32[n, 3]
        Direction of the image's u axis; the v axis is normal × tangent.
    radii : float32[n]
        Visible radius in model units: distance of the rim of an undeformed decal from its centre. One number
        stands for all decals.
    images : int32[n], optional
        Index into the scene's list of images, or NO_IMAGE (-1) for the tint alone; one each, or one for all.
        Default 0.
    spill : bool[n], optional
        True if a decal also colours surface that faces away from it, such as the far side of a thin wall; one
        each, or one for all. Default False.
    interactions : int32[n], optional
        How decals meet: an `Interaction` or its name (``"overlap"``) each, or one for all. Default PUSH.
    layers : int32[n], optional
        Layers are drawn from the lowest up; one each, or one for all. Overlapping or independent decals of
        one layer are drawn in the order of their numbers. Default 0.
    tints : float32[n, 3], optional
        sRGB colour from 0 to 1 by which the image is multiplied in linear light, or its name; one each, or
        one for all. Default white.
    opacities : float32[n], optional
        From 0 (invisible) to 1, the default. One number stands for all decals.
    receivers : str[n], optional
        Objects of the scene that a decal lies on: one of their names or labels, or several with commas, such
        as ``"hull, lid"``. One text stands for all decals. On other objects it neither shows nor pushes.
        Default ``""``: all objects, except those with ``named_only``.
    fade_angles : float32[n], optional
        Angle between the normals of decal and surface, in degrees up to 180, at which a decal has faded away;
        it begins to fade at half the angle. It replaces the facing rule and `spill`. Default 0: no fade.
    fade_depths : float32[n], optional
        Distance from the tangent plane of a decal, in its radii, at which it has faded away; it begins to
        fade at half of it. Default 0: no fade.
    single_sheets : bool[n], optional
        True if a decal keeps off other sheets of the surface, such as a plate below its own or a wall that
        crosses it. It does not act where a point lies above its tangent plane while its centre lies below
        the plane of the point, or the reverse. One each, or one for all. Default False.

    Raises
    ------
    InvalidDecals
        Wrong shapes, NaN or infinity, coordinates beyond MAX_COORDINATE, radii outside MIN_RADIUS to
        MAX_COORDINATE, zero normals or tangents, a tangent along its normal, or images, interactions, layers,
        tints, opacities or fades out of range, or receivers that are no labels or too many different ones.

    See Also
    --------
    scatter : distribute decals over models.
    DecalEditor : change decals in place.

    Examples
    --------
    >>> import decals
    >>> disks = decals.Decals(
    ...     positions=[[0, 0, 0], [1, 0, 0]],
    ...     normals=[[0, 0, 1]] * 2,
    ...     tangents=[[1, 0, 0]] * 2,
    ...     radii=[0.6, 0.3],
    ... )
    >>> disks
    Decals(2, radii from 0.3 to 0.6)
    >>> disks.replace(layers=[0, 1]).layered
    True
    >>> disks.replace(interactions="overlap", tints=["tomato", "#336699"]).tints[1].round(1).tolist()
    [0.20000000298023224, 0.4000000059604645, 0.6000000238418579]
    """

    positions: Float32Array
    normals: Float32Array
    tangents: Float32Array
    radii: Annotated[Float32Array, Values(kind=float, unit="model units")]
    _: KW_ONLY
    images: Int32Array = None  # type: ignore[assignment]  # filled in by __post_init__
    spill: Annotated[BoolArray, Values(kind=bool)] = None  # type: ignore[assignment]  # filled in by __post_init__
    interactions: Annotated[Int32Array, Values(kind=Interaction)] = None  # type: ignore[assignment]  # filled in by __post_init__
    layers: Annotated[Int32Array, Values(-8, 8, kind=int)] = None  # type: ignore[assignment]  # filled in by __post_init__
    tints: Annotated[Float32Array, Values(kind=Rgb)] = None  # type: ignore[assignment]  # filled in by __post_init__
    opacities: Annotated[Float32Array, Values(0.0, 1.0, kind=float)] = None  # type: ignore[assignment]  # filled in by __post_init__
    receivers: NDArray[Any] = None  # type: ignore[assignment]  # filled in by __post_init__
    fade_angles: Annotated[Float32Array, Values(0.0, 180.0, "°", kind=float)] = None  # type: ignore[assignment]  # filled in by __post_init__
    fade_depths: Annotated[Float32Array, Values(0.0, 2.0, "radii", kind=float)] = None  # type: ignore[assignment]  # filled in by __post_init__
    single_sheets: Annotated[BoolArray, Values(kind=bool)] = None  # type: ignore[assignment]  # filled in by __post_init__

    if TYPE_CHECKING:

        def __init__(
            self,
            positions: ArrayLike,
            normals: ArrayLike,
            tangents: ArrayLike,
            radii: ArrayLike,
            *,
            images: ArrayLike | None = None,
            spill: ArrayLike | None = None,
            interactions: ArrayLike | None = None,
            layers: ArrayLike | None = None,
            tints: ArrayLike | None = None,
            opacities: ArrayLike | None = None,
            receivers: ArrayLike | None = None,
            fade_angles: ArrayLike | None = None,
            fade_depths: ArrayLike | None = None,
            single_sheets: ArrayLike | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        positions = _positions(self.positions)
        self._keep(positions=positions, **_checked(vars(self), COLUMNS[1:], len(positions)))

    def _keep(self, **arrays: NDArray[Any]) -> None:
        """Set arrays, which are read-only from then on."""
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def empty(cls) -> Self:
        """Return 0 decals."""
        rows = np.zeros((0, 3), np.float32)
        return cls(positions=rows, normals=rows, tangents=rows, radii=rows[:, 0])

    @classmethod
    def concatenate(cls, parts: Iterable["Decals"]) -> Self:
        """Return all decals of all parts, in their order."""
        found = items(parts)
        sources = [cls.empty(), *((parts,) if found is None else found)]
        for part in sources:
            instance("parts", part, Decals, InvalidDecals, "concatenate takes several Decals")
        return cls.of_rows({name: np.concatenate([getattr(p, name) for p in sources]) for name in COLUMNS})

    @classmethod
    def of_rows(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Return decals of arrays that are rows of valid decals, by name, without another check."""
        decals = cls.__new__(cls)
        decals._keep(**{name: arrays[name] for name in COLUMNS})
        return decals

    def replace(self, **arrays: ArrayLike | None) -> Self:
        """Return decals with other arrays of these names, or with defaults for None; the result is checked.

        Raises
        ------
        InvalidDecals
            An array is invalid.
        """
        positions = _positions(arrays["positions"]) if "positions" in arrays else self.positions
        if len(positions) != len(self) or not arrays.keys() <= set(COLUMNS):
            return replace(self, **arrays)  # type: ignore[arg-type]  # any array-like is converted
        kept = {name: getattr(self, name) for name in COLUMNS}
        others = [name for name in arrays if name != "positions"]
        checked = _checked(kept | arrays, others, len(self))
        return self.of_rows({**kept, "positions": positions, **checked})

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        """Return the number of decals and the range of their radii."""
        if len(self) == 0:
            return "Decals(0)"
        return f"Decals({len(self)}, radii from {self.radii.min():.3g} to {self.radii.max():.3g})"

    def __getitem__(self, rows: slice | ArrayLike) -> Self:
        """Return some of the decals, by a slice, a mask or an array of indices; else raise InvalidRow."""
        try:
            chosen = rows if isinstance(rows, slice) else np.atleast_1d(row_selection(rows))
            arrays = {name: getattr(self, name)[chosen] for name in COLUMNS}
        except (IndexError, TypeError, ValueError, OverflowError):
            raise InvalidRow(
                f"rows: expected a slice, mask or indices of {len(self)} decals, got {describe(rows)}"
            ) from None
        return type(self).of_rows(arrays) if arrays["radii"].ndim == 1 else type(self)(**arrays)

    @property
    def bitangents(self) -> Float32Array:
        """Direction of each image's v axis, n × u: float32[n, 3]."""
        return np.cross(self.normals, self.tangents)

    @property
    def influence(self) -> Float32Array:
        """Radius s at which each decal's field ends (paper, figure 1): float32[n], radii / 0.454202."""
        return influence_of(self.radii)

    @property
    def ranks(self) -> Int32Array:
        """Position of each decal in the draw order, from the lowest up: int32[n].

        Independent or overlapping decals of equal rank are drawn in the order of their numbers. Contact
        decals of equal rank are drawn at once, because they deform each other.
        """
        return (self.layers + LAYER_LIMIT) * 4 + self.interactions

    @property
    def layered(self) -> bool:
        """True if decals can cover each other: they are not all contact decals of one layer."""
        return bool((self.interactions != Interaction.PUSH).any() or (self.layers != self.layers[:1]).any())

    def _contents(self) -> Any:
        """Return what counts; decals that reach other sheets keep the content hashes of earlier versions."""
        contents = super()._contents()
        if not self.single_sheets.any():
            del contents["single_sheets"]
        return contents

    @cached_property
    def limited(self) -> bool:
        """True if decals have receivers or fades, or keep to their sheets."""
        limits = self.fade_angles, self.fade_depths, self.single_sheets
        return bool((self.receivers != "").any() or any(values.any() for values in limits))

    @property
    def receiver_table(self) -> list[str]:
        """Different receivers, of which `limits` has the places: the first one is "", any object."""
        table = [""]
        codes_of(self.receivers, table)
        return table

    @property
    def limits(self) -> Float32Array:
        """Rows of receivers and fades that devices read: float32[n, 4], zeros where a decal has none.

        A row is (cosine at which the decal begins to fade, cosine at which it ends, depth at which it ends,
        place of its receivers in `receiver_table`). A decal that keeps to its sheet has ½ added to the place.
        """
        return self.limits_of([""])

    def limits_of(self, table: list[str]) -> Float32Array:
        """Return `limits` with places in another table of receivers; new ones are appended to it."""
        limits = np.zeros((len(self), 4), np.float32)
        if not self.limited:
            return limits
        angles = np.radians(self.fade_angles.astype(np.float64))
        fading = angles > 0.0
        limits[fading, 0], limits[fading, 1] = np.cos(0.5 * angles[fading]), np.cos(angles[fading])
        limits[:, 2] = self.fade_depths
        limits[:, 3] = codes_of(self.receivers, table) + np.where(self.single_sheets, 0.5, 0.0)
        return limits

    def packed(self) -> Float32Array:
        """Return the records that devices read: float32[4n, 4], RECORD rows for each decal.

        Rows are (position, s), (normal, rank), (tangent, image) and (tint in linear light, opacity), with the
        influence radius s. A decal that spills has ½ added to its rank. `decals.record` reads the records.
        """
        record = np.empty((len(self), RECORD, 4), np.float32)
        record[:, 0, :3] = self.positions
        record[:, 0, 3] = self.influence
        record[:, 1, :3] = self.normals
        record[:, 1, 3] = self.ranks + np.where(self.spill, 0.5, 0.0)
        record[:, 2, :3] = self.tangents
        record[:, 2, 3] = self.images
        record[:, 3, :3] = decode_srgb(self.tints.astype(np.float64))
        record[:, 3, 3] = self.opacities
        return record.reshape(-1, 4)


def influence_of(radii: Float32Array) -> Float32Array:
    """Return the influence radii of visible ones, see `Decals.influence`."""
    return (radii / np.float64(RIM)).astype(np.float32)


def checked_column(name: str, values: Any, count: int) -> NDArray[Any]:
    """Return a new array for a column other than normals and tangents, checked as by `Decals`.

    None stands for the default. Positions may have another length than `count`.

    Raises
    ------
    InvalidDecals
        A value is invalid.
    """
    if name == "positions":
        return _positions(values)
    if values is None and name in _DEFAULTS:
        value, dtype = _DEFAULTS[name]
        return np.full((count, *np.shape(value)), value, dtype)
    return _CHECKS[name](values, count)


def _positions(values: Any) -> Float32Array:
    positions = finite_array("positions", values, (-1, 3))
    check_range("positions", positions, -MAX_COORDINATE, MAX_COORDINATE)
    return positions.astype(np.float32)


def _frames(values: Mapping[str, Any], count: int) -> dict[str, Float32Array]:
    """Return unit normals, and unit tangents perpendicular to them."""
    normals, tangents = (
        unit_vectors(name, finite_array(name, values[name], (count, 3))) for name in ("normals", "tangents")
    )
    perpendicular = orthogonal_vectors(tangents, normals)
    return {"normals": normals.astype(np.float32), "tangents": perpendicular.astype(np.float32)}


def _radii(values: Any, count: int) -> Float32Array:
    radii = finite_array("radii", one_or_each(values, count), (count,))
    check_range("radii", radii, MIN_RADIUS, MAX_COORDINATE)
    return radii.astype(np.float32)


def _opacities(values: Any, count: int) -> Float32Array:
    return unit_interval("opacities", one_or_each(values, count), (count,)).astype(np.float32)


def _fades(name: str, low: float, high: float, values: Any, count: int) -> Float32Array:
    array = finite_array(name, one_or_each(values, count), (count,))
    check_range(name, np.where(array == 0.0, low, array), low, high, advice="0 is no fade")
    return array.astype(np.float32)


def _checked(values: Mapping[str, Any], names: Collection[str], count: int) -> dict[str, NDArray[Any]]:
    """Return new arrays of these columns for so many decals; of normals or tangents always both."""
    arrays: dict[str, NDArray[Any]] = {}
    if not _FRAME.isdisjoint(names):
        arrays |= _frames(values, count)
    arrays |= {name: checked_column(name, values[name], count) for name in names if name not in _FRAME}
    return arrays


COLUMNS = tuple(field.name for field in fields(Decals))
"""Names of the arrays of `Decals`."""

_FRAME = frozenset(("normals", "tangents"))

_DEFAULTS: dict[str, tuple[Any, Any]] = {
    "images": (0, np.int32),
    "spill": (False, np.bool_),
    "interactions": (Interaction.PUSH, np.int32),
    "layers": (0, np.int32),
    "tints": ((1.0, 1.0, 1.0), np.float32),
    "opacities": (1.0, np.float32),
    "receivers": ("", TEXT),
    "fade_angles": (0.0, np.float32),
    "fade_depths": (0.0, np.float32),
    "single_sheets": (False, np.bool_),
}
"""Value of a decal and type of the array, of columns that may be left out."""

_CHECKS: dict[str, Callable[[Any, int], NDArray[Any]]] = {
    "radii": _radii,
    "images": partial(whole_array, "images", low=NO_IMAGE, high=MAX_IMAGES - 1),
    "spill": partial(bool_array, "spill"),
    "interactions": partial(member_array, "interactions", kind=Interaction),
    "layers": partial(whole_array, "layers", low=-LAYER_LIMIT, high=LAYER_LIMIT - 1),
    "tints": partial(color_array, "tints"),
    "opacities": _opacities,
    "receivers": partial(receiver_array, "receivers"),
    "fade_angles": partial(_fades, "fade_angles", *FADE_ANGLES),
    "fade_depths": partial(_fades, "fade_depths", *FADE_DEPTHS),
    "single_sheets": partial(bool_array, "single_sheets"),
}
"""Checks of the columns besides positions and frames: of given values and a number of rows."""
