"""`evaluate_batch`: many sets of decals at points, in one launch where a loop would starve a device."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, overload

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.device import known_device
from blobtree.validation import axis_count, describe, items
from decals.errors import InvalidDevice, InvalidPoints, InvalidScene
from decals.field.evaluate import (
    Samples,
    checked_truths,
    samples_of,
    walk_texels,
)
from decals.field.image_texels import MaterialSamples, UploadedImages
from decals.field.mapping import ImageMapping
from decals.field.points import (
    Rows,
    checked_rows,
    checked_turns,
    device_of,
    joined_arrays,
    joined_rows,
    like,
    on_host,
    part_of,
    place,
    placed,
    rows_on,
)
from decals.field.query import Neighbors, Query, Target, image_count
from decals.field.rules import AnyContact, PictureRules
from decals.field.sampling_kernels import sample_images, sample_points
from decals.field.walks import Walks
from decals.images.load import AnyImage
from decals.index.batch import DecalBatch, checked_sets
from decals.index.build import starts_of
from decals.model import Decals
from decals.receivers import mask_on, takes_named_only
from decals.record import DEFAULT_CONTACT, DEFAULT_STIFFNESS, NEIGHBOR_REACH

MAX_DECALS = 1 << 18
"""Decals that are indexed at once; their index takes half a gigabyte at most."""

MAX_ROWS = 1 << 22
"""Points that are evaluated at once."""


class BatchTarget:
    """Many sets of decals, and the set of each result; see `Target`."""

    def __init__(self, batch: DecalBatch, sets: Int32Array) -> None:
        self._batch, self._sets, self.device = batch, sets, batch.device
        self._sets_on_device: Any = wp.array(sets, dtype=wp.int32, device=batch.device)
        self.image_count, self.records = image_count(batch.joined), batch.records

    def kernel(self, single: Any) -> Any:
        """Return the kernel for these decals."""
        from decals.field import batch_kernels as kernels  # compiled at the first use

        if single is sample_points:
            return kernels.sample_sets
        if single is sample_images:
            return kernels.sample_images_of_sets
        from decals.field.batch_neighbor_kernels import list_neighbors_of_sets

        return list_neighbors_of_sets

    def arguments(self) -> list[Any]:
        """Return the arguments of kernels that stand for the decals."""
        return [self._batch.rows(), self._sets_on_device]

    def count(self, points: Any) -> int:
        """Return the number of results."""
        return len(self._sets)

    def places(self, owners: Int32Array) -> Int64Array:
        """Return the places in `records` of owners."""
        return np.where(owners >= 0, owners + self._batch.starts[self._sets], -1)

    def wide(self) -> tuple[Target, Int64Array | None]:
        """Return decals with a wide index, and the numbers of its rows."""
        return BatchTarget(self._batch.with_reach(1.0 / NEIGHBOR_REACH), self._sets), None


@dataclass(frozen=True, eq=False)
class BatchSamples(Sequence[Samples]):
    """Many sets of decals at points, as `evaluate_batch` returns them.

    ``batch[i]`` are the `Samples` of set i, as `evaluate` returns them for this set alone. The arrays hold
    the rows of all sets, one set after the other. Where all sets have the same m points,
    ``batch.owner.reshape(len(batch), m)`` has a row for each set.

    Attributes
    ----------
    offsets : int64[k + 1]
        Rows ``offsets[i]:offsets[i + 1]`` are those of set i.
    owner : int32[n]
        Number of the topmost decal in its set; −1 outside all rims.
    uv, field, color, height, jacobian, neighbors, materials
        See `Samples`.

    Examples
    --------
    >>> import decals
    >>> disk = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], radii=1)
    >>> batch = decals.evaluate_batch([disk, disk.replace(radii=0.3)], [[0.5, 0, 0]], [[0, 0, 1]])
    >>> len(batch), batch.owner.tolist(), batch[0].uv.tolist()
    (2, [0, -1], [[0.75, 0.5]])
    """

    offsets: Int64Array
    owner: Int32Array
    uv: Float32Array
    field: Float32Array
    color: Float32Array | None = None
    jacobian: Float64Array | None = None
    neighbors: Neighbors | None = None
    height: Float32Array | None = None
    materials: MaterialSamples | None = None

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @overload
    def __getitem__(self, number: int) -> Samples: ...

    @overload
    def __getitem__(self, number: slice) -> list[Samples]: ...

    def __getitem__(self, number: int | slice) -> Samples | list[Samples]:
        """Return the samples of one set, or of several; they share the memory of the batch."""
        numbers = range(len(self))[number]
        if isinstance(numbers, range):
            return [self._samples(each) for each in numbers]
        return self._samples(numbers)

    def _samples(self, number: int) -> Samples:
        first, last = self.offsets[number : number + 2].tolist()
        return Samples(
            **{field.name: _part(getattr(self, field.name), first, last) for field in fields(Samples)}
        )


def evaluate_batch(
    sets: Iterable[Decals] | DecalBatch,
    points: ArrayLike | Sequence[ArrayLike],
    normals: ArrayLike | Sequence[ArrayLike],
    *,
    mapping: ImageMapping | str = ImageMapping.CORRECTED,
    contact: AnyContact | str = DEFAULT_CONTACT,
    stiffness: float = DEFAULT_STIFFNESS,
    images: AnyImage | Iterable[AnyImage] | None = None,
    jacobian: bool = False,
    normal_derivatives: ArrayLike | Sequence[ArrayLike] | None = None,
    neighbors: bool = False,
    materials: bool = False,
    on: object | str | Iterable[str] | None = None,
    walks: Iterable[Walks] | None = None,
    device: Any = None,
) -> BatchSamples:
    """Evaluate many sets of decals at surface points, each as `evaluate` does it alone.

    The sets are indexed together, and one launch evaluates all of them. On a graphics card that is much
    faster than a loop over small sets. On a processor the results are those of the loop bit for bit. Very
    many sets are divided into parts that fit into memory.

    Parameters
    ----------
    sets : iterable of Decals, or DecalBatch
        k sets, of any numbers of decals. A `decals.index.DecalBatch` keeps their indices from call to call.
    points, normals : float32[m, 3], or k arrays float32[mᵢ, 3]
        The points of all sets, or those of each set; their normals in the same form. They may stay on their
        device, see `evaluate`.
    mapping, contact, stiffness, images, jacobian, neighbors, materials, on, device
        See `evaluate`; they hold for all sets.
    normal_derivatives : float[m, 3, 3], or k arrays float[mᵢ, 3, 3], optional
        Derivatives of the normals by the point, in the form of the points.
    walks : k Walks, optional
        Log maps around the decals of each set, which the mapping WALKED needs.

    Returns
    -------
    BatchSamples
        A sequence of the `Samples` of each set.

    Raises
    ------
    InvalidDecals
        An item of `sets` is not a set of decals.
    InvalidPoints, InvalidImage, InvalidScene, InvalidDevice
        As for `evaluate`; or the number of arrays is not that of the sets.

    See Also
    --------
    evaluate : one set of decals.

    Examples
    --------
    >>> import decals, numpy
    >>> disk = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], radii=1)
    >>> sets = [disk.replace(radii=radius) for radius in (0.25, 0.5, 1.0)]
    >>> line = [[x, 0, 0] for x in (0.1, 0.4, 0.7)]
    >>> batch = decals.evaluate_batch(sets, line, [[0, 0, 1]] * 3)
    >>> batch.owner.reshape(3, 3).tolist()
    [[0, -1, -1], [0, 0, -1], [0, 0, 0]]
    """
    listed = sets.sets if isinstance(sets, DecalBatch) else checked_sets(sets)
    rules = PictureRules(mapping=mapping, contact=contact, stiffness=stiffness)
    checked_truths(jacobian=jacobian, neighbors=neighbors, materials=materials)
    places = _Places.of(listed, points, normals, normal_derivatives)
    device = places.device(sets.device if isinstance(sets, DecalBatch) and device is None else device)
    if isinstance(sets, DecalBatch) and device != sets.device:
        raise InvalidDevice(f"device: expected {sets.device!r}, where the sets lie, got {device!r}")
    walked = _checked_walks(walks, listed) if rules.walked else None
    texels = None if images is None else UploadedImages.of(images, device, materials=materials)
    parts = []
    counts = [0 if isinstance(sets, DecalBatch) else len(part) for part in listed]
    for first, last in _chunks(counts, np.diff(places.offsets).tolist()):
        rows, set_of, turns = places.chunk(first, last)
        if isinstance(sets, DecalBatch):
            batch, own, set_of = sets.copied(), slice(None), set_of + np.int32(first)
        else:
            batch, own = DecalBatch(listed[first:last], device), slice(first, last)
        _apply(rules, batch, on, None if walked is None else walked[own])
        query = Query(BatchTarget(batch, set_of), *rows_on(device, rows), rules.contact, texels)
        part = samples_of(query, texels, turns, jacobian=jacobian, neighbors=neighbors)
        parts.append(placed(part, device, stay=places.stay))
    return BatchSamples(
        places.offsets,
        **{field.name: _joined([getattr(part, field.name) for part in parts]) for field in fields(Samples)},
    )


@dataclass(frozen=True)
class _Places:
    """Points, normals and their derivatives of k sets, and which rows of a batch are those of a set."""

    points: list[Rows]
    """Those of each set, or those that all sets share."""
    turns: list[Float64Array | None]
    offsets: Int64Array
    shared: bool

    @classmethod
    def of(cls, sets: Sequence[Decals], points: Any, normals: Any, normal_derivatives: Any) -> "_Places":
        """Return checked places; raise InvalidPoints for arrays of wrong shapes or numbers."""
        count = len(sets)
        if not _is_each("points", points, 2):
            rows = checked_rows(points, normals)
            turn = checked_turns(normal_derivatives, len(rows[0]))
            return cls([rows], [turn], np.arange(count + 1, dtype=np.int64) * len(rows[0]), True)
        given = {"points": points, "normals": normals}
        each = [_each_of(name, values, count) for name, values in given.items()]
        pairs = [checked_rows(*pair) for pair in zip(*each, strict=True)]
        turns: list[Float64Array | None] = [None] * count
        if normal_derivatives is not None:
            listed = _each_of("normal_derivatives", normal_derivatives, count)
            turns = [checked_turns(turn, len(rows[0])) for turn, rows in zip(listed, pairs, strict=True)]
        return cls(pairs, turns, starts_of([len(rows[0]) for rows in pairs]), False)

    @property
    def stay(self) -> bool:
        """True if results stay on the device of the points."""
        return any(rows.stay for rows in self.points)

    def device(self, device: Any) -> str:
        """Return the name of the device of all points; raise InvalidPoints if they lie on several."""
        places = [place(rows.points) for rows in self.points]
        for number, other in enumerate(places):
            if other != places[0]:
                raise InvalidPoints(
                    f"points[{number}]: expected an array {places[0]} like that of the first set, got one "
                    f"{other}; move it there"
                )
        return device_of(self.points[0], device) if self.points else known_device(device)

    def chunk(self, first: int, last: int) -> tuple[Rows, Int32Array, Float64Array | None]:
        """Return points and normals of some sets, the set of each row, and derivatives of the normals."""
        counts = np.diff(self.offsets[first : last + 1])
        sets = np.repeat(np.arange(last - first, dtype=np.int32), counts)
        if self.shared:
            turn = self.turns[0]
            return self.points[0], sets, None if turn is None else np.tile(turn, (last - first, 1, 1))
        turns = [turn for turn in self.turns[first:last] if turn is not None]
        rows = joined_rows(self.points[first:last])
        return rows, sets, np.concatenate(turns) if turns else None


def _is_each(name: str, values: Any, axes: int) -> bool:
    """Return True if values are arrays with so many axes, one for each set; False for one array."""
    if hasattr(values, "ndim"):
        return axis_count(values) > axes
    if hasattr(values, "__dlpack__"):  # its shape is known through DLPack alone: an array for all sets
        return False
    listed = items(values)
    if listed is None:
        raise InvalidPoints(f"{name}: expected an array [m, 3], or one for each set, got {describe(values)}")
    return not listed or axis_count(listed[0]) >= axes


def _each_of(name: str, values: Any, count: int) -> tuple[Any, ...]:
    is_warp = isinstance(values, wp.array)  # which have no iterator
    listed = tuple(values[row] for row in range(len(values))) if is_warp else items(values)
    if listed is None or len(listed) != count:
        got = describe(values) if listed is None else f"{len(listed)}"
        raise InvalidPoints(
            f"{name}: expected one array for each of {count} sets, or one array [m, 3] for all, got {got}"
        )
    return listed


def _checked_walks(walks: Any, sets: Sequence[Decals]) -> list[Float32Array]:
    """Return the texels of the walks of each set; raise InvalidScene if they are not of these sets."""
    listed = None if walks is None or isinstance(walks, Walks) else items(walks)
    if listed is None or len(listed) != len(sets):
        got = describe(walks) if listed is None else f"{len(listed)}"
        raise InvalidScene(
            f"walks: expected those of each of {len(sets)} sets for the mapping WALKED, got {got}"
        )
    return [walk_texels(walk, len(part)) for walk, part in zip(listed, sets, strict=True)]


def _apply(
    rules: PictureRules,
    batch: DecalBatch,
    on: object | str | Iterable[str] | None,
    walked: Sequence[Float32Array] | None,
) -> None:
    """Give a batch the rules, the surface that the points lie on, and its walks."""
    rules.apply(batch.modes)
    if on is not None or batch.joined.limited:
        masks = [mask_on(on, part.receiver_table, InvalidScene) for part in batch.sets]
        batch.limit(masks, always=takes_named_only(on))
    if walked is not None:
        none = np.zeros((0, 4), np.float32)
        batch.walk(np.concatenate([none, *walked]), starts_of([len(texels) for texels in walked]))


def _chunks(decals: Sequence[int], rows: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Yield ranges of sets that are evaluated at once; no set at all is one empty range."""
    first = taken = points = 0
    for number, (count, places) in enumerate(zip(decals, rows, strict=True)):
        if number > first and (taken + count > MAX_DECALS or points + places > MAX_ROWS):
            yield first, number
            first, taken, points = number, 0, 0
        taken, points = taken + count, points + places
    yield first, len(decals)


def _joined(parts: list[Any]) -> Any:
    """Return arrays of all chunks, one after the other."""
    if len(parts) == 1 or parts[0] is None:
        return parts[0]
    if isinstance(parts[0], Neighbors):
        offsets = [on_host(part.offsets) for part in parts]
        ends = np.cumsum([part[-1] for part in offsets])
        starts = [part[1:] + end - part[-1] for part, end in zip(offsets, ends, strict=True)]
        lists = (joined_arrays([getattr(part, name) for part in parts]) for name in _LISTS)
        return Neighbors(like(parts[0].offsets, np.concatenate([[0], *starts])), *lists)
    if isinstance(parts[0], MaterialSamples):
        names = [field.name for field in fields(MaterialSamples)]
        return MaterialSamples(**{name: _joined([getattr(part, name) for part in parts]) for name in names})
    return joined_arrays(parts)


_LISTS = tuple(field.name for field in fields(Neighbors) if field.name != "offsets")


def _part(values: Any, first: int, last: int) -> Any:
    """Return some rows of the samples of all sets."""
    if isinstance(values, Neighbors):
        offsets = on_host(values.offsets)[first : last + 1]
        ends = int(offsets[0]), int(offsets[-1])
        lists = (part_of(getattr(values, name), *ends) for name in _LISTS)
        return Neighbors(like(values.offsets, offsets - offsets[0]), *lists)
    if isinstance(values, MaterialSamples):
        names = [field.name for field in fields(MaterialSamples)]
        parts = {name: part_of(getattr(values, name), first, last) for name in names}
        return MaterialSamples(**parts)
    return None if values is None else part_of(values, first, last)
