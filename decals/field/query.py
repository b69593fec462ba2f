"""Decals on a device that are evaluated at points: one set of them, or many sets at once."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.device import launch
from decals.field.contact_mode import AnyContact, with_law
from decals.field.image_texels import UploadedImages
from decals.field.jacobian import image_jacobians
from decals.field.sampling_kernels import sample_images, sample_points
from decals.index.editor import DecalEditor
from decals.index.index import index_on
from decals.model import NO_IMAGE, Decals
from decals.record import NEIGHBOR_REACH, RECORD, RIM_RADIUS


@dataclass(frozen=True, eq=False)
class Neighbors:
    """All decals that act at m points, in one list; those of point i are at ``offsets[i]:offsets[i + 1]``.

    Attributes
    ----------
    offsets : int64[m + 1]
        First entry of each point.
    decals : int32[k]
        Numbers of the decals with a field above 0, ascending for each point.
    fields : float32[k]
        Field f of each before contact (paper, equation 1): ½ on its undeformed rim.
    pushes : float32[k]
        Push of each alone on the owner of the point: by which share of what is left to its rim it moves the
        image outward. 0 without a push, 1 on their contact line. In PRODUCT and MIN this is 1 − h of equation
        5, in RADIAL and ELASTIC a share of the way along the ray. In RADIAL a decal that has no field at the
        point can push there too; it is not listed.
    alone : bool[k]
        True where the undeformed image of the decal reaches the point.
    in_layer : bool[k]
        True where its image does after contact: without the decals above it, the decal would show.
    """

    offsets: Int64Array
    decals: Int32Array
    fields: Float32Array
    pushes: Float32Array
    alone: BoolArray
    in_layer: BoolArray


class Target(Protocol):
    """Decals on a device, as arguments of kernels.

    Attributes
    ----------
    device : str
        The Warp device.
    image_count : int
        Number of images to which the decals refer.
    records : wp.array(dtype=vec4)
        Records of all decals.
    """

    device: str
    image_count: int
    records: Any

    def kernel(self, single: Any) -> Any:
        """Return the kernel for these decals that does the same as one for a single set."""

    def arguments(self) -> list[Any]:
        """Return the arguments of kernels that stand for the decals."""

    def count(self, points: Any) -> int:
        """Return the number of results at these points."""

    def places(self, owners: Int32Array) -> Int64Array:
        """Return the places in `records` of owners; −1 stays −1."""

    def wide(self) -> "tuple[Target, Int64Array | None]":
        """Return decals whose index lists whole influences, and the numbers of its rows if they differ."""


class SingleTarget:
    """One set of decals; see `Target`."""

    def __init__(self, decals: Decals | DecalEditor, indexed: Any, device: str) -> None:
        self._decals, self._indexed, self.device = decals, indexed, device
        self.image_count, self.records = image_count(rows_of(decals)), indexed.records

    def kernel(self, single: Any) -> Any:
        """Return the kernel for these decals."""
        return single

    def arguments(self) -> list[Any]:
        """Return the arguments of kernels that stand for the decals."""
        return [self._indexed]

    def count(self, points: Any) -> int:
        """Return the number of results."""
        return len(points)

    def places(self, owners: Int32Array) -> Int64Array:
        """Return the places in `records` of owners."""
        return owners.astype(np.int64)

    def wide(self) -> tuple[Target, Int64Array | None]:
        """Return decals with a wide index, and the numbers of its rows."""
        decals, indexed, rows = self._decals, self._indexed, rows_of(self._decals)
        known = decals.numbers if isinstance(decals, DecalEditor) else None
        wide = index_on(rows, self.device, reach=1.0 / NEIGHBOR_REACH)
        for name in ("stiffness", "surface", "limited", "mapping", "walked", "walks"):
            setattr(wide, name, getattr(indexed, name))
        if wide.walked and known is not None:  # an editor has rows that are no decals
            texels = indexed.walks.numpy()
            texels[: len(known)] = texels[known]
            wide.walks = wp.array(texels, dtype=wp.vec4, device=self.device)
        if wide.limited:
            limits = rows.limits_of(decals.receiver_table)
            wide.limits = wp.array(limits, dtype=wp.vec4, device=self.device)
        return SingleTarget(rows, wide, self.device), known


class Query:
    """Decals at points, in a contact mode or law, and the images of the decals.

    Attributes
    ----------
    owners, uv, fields
        See `Samples`; arrays on the device.
    sums
        What the images give, an `ImageSums`; None without images.
    """

    def __init__(
        self, target: Target, points: Any, normals: Any, contact: AnyContact, images: UploadedImages | None
    ) -> None:
        self._target, self._contact, self._device = target, contact, target.device
        self._points, self._normals = points, normals
        self._count = target.count(points)
        if images is not None:
            images.check(target.image_count)
        self.owners, self.uv, self.fields, self.sums = self._sampled(points, normals, images)

    def _inputs(self, points: Any, normals: Any) -> list[Any]:
        return [points, normals, int(self._contact), *self._target.arguments()]

    def _launch(self, kernel: Any, inputs: list[Any], outputs: list[Any]) -> None:
        launch(
            with_law(self._target.kernel(kernel), self._contact), self._count, inputs, outputs, self._device
        )

    def _sampled(self, points: Any, normals: Any, images: UploadedImages | None = None) -> list[Any]:
        outputs = zeros(self._device, self._count, wp.int32, wp.vec2, wp.float32)
        inputs = self._inputs(points, normals)
        if images is None:
            self._launch(sample_points, inputs, outputs)
            return [*outputs, None]
        sums = images.sums(self._count, self._device)
        self._launch(sample_images, [*inputs, *outputs, images.texels], [sums])
        return [*outputs, sums]

    def _on_device(self, rows: Float32Array) -> Any:
        return wp.array(rows, dtype=wp.vec3, device=self._device)

    @cached_property
    def _host_owners(self) -> Int32Array:
        owners: Int32Array = self.owners.numpy()
        return owners

    @cached_property
    def _host_rows(self) -> tuple[Float32Array, Float32Array]:
        """Points and normals of all results."""
        rows = [array.numpy() for array in (self._points, self._normals)]
        repeats = 1 if len(rows[0]) == self._count else self._count // max(len(rows[0]), 1)
        return np.tile(rows[0], (repeats, 1)), np.tile(rows[1], (repeats, 1))

    def jacobians(self, normal_derivatives: Float64Array | None) -> Float64Array:
        """Return derivatives of image coordinates."""
        spheres: Float32Array = self._target.records.numpy()[::RECORD, 3]
        radii = np.ones(self._count)
        places = self._target.places(self._host_owners)
        owned = places >= 0
        radii[owned] = RIM_RADIUS * spheres[places[owned]]

        def sampled(points: Float32Array, normals: Float32Array) -> tuple[Int32Array, Float32Array]:
            owner, uv, *_ = self._sampled(self._on_device(points), self._on_device(normals))
            return owner.numpy(), uv.numpy()

        center = self._host_owners, self.uv.numpy()
        return image_jacobians(sampled, *self._host_rows, radii, center, normal_derivatives)

    def neighbors(self) -> Neighbors:
        """Return all decals with a field at points; the index lists whole influences, not only reaches."""
        from decals.field.neighbor_kernels import (  # compiled at the first use
            SHOWS_ALONE,
            SHOWS_IN_LAYER,
            list_neighbors,
        )

        device, count = self._device, self._count
        target, known = self._target.wide()
        empty = zeros(device, 0, wp.int32, wp.float32)
        (counts,) = zeros(device, count, wp.int32)
        owners = self._host_owners
        if known is not None:
            owners = np.where(owners >= 0, np.searchsorted(known, owners), owners).astype(np.int32)
        placed: Any = wp.array(owners, dtype=wp.int32, device=device)
        given = [self._points, self._normals, int(self._contact), *target.arguments(), placed]
        self._launch(list_neighbors, [*given, empty[0]], [counts, empty[0], empty[1], empty[1], empty[0]])
        offsets = np.concatenate([[0], np.cumsum(counts.numpy(), dtype=np.int64)])
        starts: Any = wp.array(offsets[:-1], dtype=wp.int32, device=device)
        total = int(offsets[-1])
        lists = zeros(device, total, wp.int32, wp.float32, wp.float32, wp.int32)
        if total:
            self._launch(list_neighbors, [*given, starts], [counts, *lists])
        order = np.lexsort((lists[0].numpy(), np.repeat(np.arange(count), np.diff(offsets))))
        found, fields, pushes, shows = (values.numpy()[order] for values in lists)
        numbers = found if known is None else known[found].astype(np.int32)
        alone, in_layer = ((shows & bit) > 0 for bit in (SHOWS_ALONE, SHOWS_IN_LAYER))
        return Neighbors(offsets, numbers, fields, pushes, alone, in_layer)


def zeros(device: Any, count: int, *kinds: Any) -> list[Any]:
    """Return arrays of zeros of several types."""
    return [wp.zeros(count, dtype=kind, device=device) for kind in kinds]


def rows_of(decals: Decals | DecalEditor) -> Decals:
    """Return the decals of an editor, or decals themselves."""
    return decals.decals if isinstance(decals, DecalEditor) else decals


def image_count(decals: Decals) -> int:
    """Return the number of images to which decals refer."""
    return int(decals.images.max(initial=NO_IMAGE)) + 1
