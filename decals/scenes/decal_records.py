"""Decals as a scene file has them: a record each, the usual left out."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import UNSET, Meta, Struct, UnsetType
from numpy.typing import NDArray

from decals.errors import DecalsError, InvalidScene
from decals.model import PLAIN, Decals, Interaction
from decals.scenes.camera import Vector

Whole = Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)]

_INTERACTIONS = {kind.name.lower(): kind for kind in Interaction}


class DecalRecord(Struct, forbid_unknown_fields=True):
    """One decal; `decals.scenes.scene_file` shows it in a file."""

    position: Vector
    normal: Vector
    tangent: Vector
    radius: float
    image: Annotated[int, Meta(ge=PLAIN, le=2**31 - 1)] = 0
    spill: bool = False
    interaction: Literal["independent", "contact", "overlap"] | UnsetType = UNSET
    layer: Whole | UnsetType = UNSET
    tint: Vector | UnsetType = UNSET
    opacity: float | UnsetType = UNSET


def records_of(decals: Decals) -> Iterator[DecalRecord]:
    """Describe decals, in their order."""
    columns = (
        _rows(_decimals(decals.positions)),
        _rows(_decimals(decals.normals)),
        _rows(_decimals(decals.tangents)),
        _decimals(decals.radii).tolist(),
        decals.images.tolist(),
        decals.spill.tolist(),
        _unless_default(decals.interactions, Interaction.CONTACT, list(_INTERACTIONS)),
        _unless_default(decals.layers, 0),
        _unless_default(_decimals(decals.tints), 1.0),
        _unless_default(_decimals(decals.opacities), 1.0),
    )
    return (DecalRecord(*values) for values in zip(*columns, strict=True))


def _unless_default(array: NDArray[Any], default: float, names: Sequence[str] | None = None) -> Iterator[Any]:
    """Give each row's value, or its name, as JSON has it; UNSET where it is the default throughout."""
    usual = (array == default).all(axis=tuple(range(1, array.ndim)))
    for value, omit in zip(array.tolist(), usual.tolist(), strict=True):
        known = value if names is None else names[value]
        yield UNSET if omit else tuple(known) if isinstance(known, list) else known


def _given(value: Any, default: Any) -> Any:
    """Give the default for what a file leaves out."""
    return default if value is UNSET else value


def _whole(values: Iterable[int]) -> NDArray[np.int32]:
    return np.array(list(values), np.int32)


def _rows(array: NDArray[np.float64]) -> list[Any]:
    return [tuple(row) for row in array.tolist()]


def _decimals(array: NDArray[np.float32]) -> NDArray[np.float64]:
    """Doubles whose shortest decimal is that of the float32, and which round to it again."""
    short = array.astype(np.str_).astype(np.float64)
    return np.where(short.astype(np.float32) == array, short, array.astype(np.float64))


def decals_of(records: list[DecalRecord]) -> Decals:
    """Make the decals that were described.

    Raises
    ------
    InvalidScene
        If one of them cannot be.
    """
    if not records:
        return Decals.empty()
    with np.errstate(over="ignore"):  # what overflows float32 is refused as infinite
        return _checked_decals(records)


def _checked_decals(records: list[DecalRecord]) -> Decals:
    try:
        return Decals(
            positions=np.array([record.position for record in records], np.float32),
            normals=np.array([record.normal for record in records], np.float32),
            tangents=np.array([record.tangent for record in records], np.float32),
            radii=np.array([record.radius for record in records], np.float32),
            images=_whole(record.image for record in records),
            spill=np.array([record.spill for record in records], np.bool_),
            interactions=_whole(_INTERACTIONS[_given(r.interaction, "contact")] for r in records),
            layers=_whole(_given(record.layer, 0) for record in records),
            tints=np.array([_given(record.tint, (1.0, 1.0, 1.0)) for record in records], np.float32),
            opacities=np.array([_given(record.opacity, 1.0) for record in records], np.float32),
        )
    except DecalsError as error:
        raise InvalidScene(f"decals: {error}") from error
