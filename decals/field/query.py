"""Decals on a device that are evaluated at points: one set of them, or many sets at once."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float32Array, Int32Array, Int64Array
from blobtree.device import launch
from decals.field.image_texels import UploadedImages
from decals.field.rules import AnyContact, with_law
from decals.field.sampling_kernels import sample_images, sample_points
from decals.index.editor import DecalEditor
from decals.index.index import index_on
from decals.model import NO_IMAGE, Decals
from decals.record import NEIGHBOR_REACH


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
        """Return the kernel for these decals in place of a kernel for a single set."""

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
        self.target, self.contact, self.device = target, contact, target.device
        self.points, self.normals = points, normals
        self.count = target.count(points)
        if images is not None:
            images.check(target.image_count)
        self.owners, self.uv, self.fields, self.sums = self.sampled(points, normals, images)

    def _inputs(self, points: Any, normals: Any) -> list[Any]:
        return [points, normals, int(self.contact), *self.target.arguments()]

    def launch(self, kernel: Any, inputs: list[Any], outputs: list[Any]) -> None:
        """Run a kernel, that of these decals and this contact, once for each result."""
        launch(with_law(self.target.kernel(kernel), self.contact), self.count, inputs, outputs, self.device)

    def sampled(self, points: Any, normals: Any, images: UploadedImages | None = None) -> list[Any]:
        """Return owners, image coordinates, fields and sums of images at points on the device."""
        outputs = zeros(self.device, self.count, wp.int32, wp.vec2, wp.float32)
        inputs = self._inputs(points, normals)
        if images is None:
            self.launch(sample_points, inputs, outputs)
            return [*outputs, None]
        sums = images.sums(self.count, self.device)
        self.launch(sample_images, [*inputs, *outputs, images.texels], [sums])
        return [*outputs, sums]

    def on_device(self, rows: Float32Array) -> Any:
        """Return rows as an array of vectors on the device."""
        return wp.array(rows, dtype=wp.vec3, device=self.device)

    @cached_property
    def host_owners(self) -> Int32Array:
        """Owners in the memory of the host."""
        owners: Int32Array = self.owners.numpy()
        return owners

    @cached_property
    def host_rows(self) -> tuple[Float32Array, Float32Array]:
        """Points and normals of all results."""
        rows = [array.numpy() for array in (self.points, self.normals)]
        repeats = 1 if len(rows[0]) == self.count else self.count // max(len(rows[0]), 1)
        return np.tile(rows[0], (repeats, 1)), np.tile(rows[1], (repeats, 1))


def zeros(device: Any, count: int, *kinds: Any) -> list[Any]:
    """Return arrays of zeros of several types."""
    return [wp.zeros(count, dtype=kind, device=device) for kind in kinds]


def rows_of(decals: Decals | DecalEditor) -> Decals:
    """Return the decals of an editor, or decals themselves."""
    return decals.decals if isinstance(decals, DecalEditor) else decals


def image_count(decals: Decals) -> int:
    """Return the number of images to which decals refer."""
    return int(decals.images.max(initial=NO_IMAGE)) + 1
