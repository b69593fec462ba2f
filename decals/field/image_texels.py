"""Images on a device, as `evaluate` reads them: colours, heights and maps of materials."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import Float32Array
from decals.errors import InvalidImage
from decals.field.sampling_kernels import COLORS, EMISSIONS, NORMALS, SURFACES, ImageSums, ImageTexels
from decals.images.load import AnyImage, each_image, image_pixels
from decals.images.texels import linear_premultiplied, unit_levels


@dataclass(frozen=True, eq=False)
class MaterialSamples:
    """Maps of materials at m points, mixed by the part that is seen of each decal.

    Attributes
    ----------
    part : float32[m]
        Part of the surface that materials cover. The other values are sums over it: 0 without materials.
    normal : float32[m, 3]
        Sum of unit normals. Where decals with several normals lie over each other, their maps are turned as
        that of the topmost one.
    roughness, metallic, occlusion : float32[m]
        Sums of the maps.
    emission : float32[m, 3]
        Light that the surface sheds itself, in linear light.
    """

    part: Float32Array
    normal: Float32Array
    roughness: Float32Array
    metallic: Float32Array
    occlusion: Float32Array
    emission: Float32Array


@dataclass(frozen=True, eq=False)
class UploadedImages:
    """Images on a device.

    Attributes
    ----------
    texels
        Their `ImageTexels`.
    raised, shining
        True if some have heights, or maps of materials.
    """

    texels: Any
    raised: bool
    shining: bool

    @classmethod
    def of(
        cls, images: AnyImage | Iterable[AnyImage], device: Any, *, heights: bool = True, materials: bool
    ) -> "UploadedImages":
        """Return images of any kind on a device, with their heights and maps of materials, if any."""
        listed = each_image(images)
        pixels = [image_pixels(image, name=f"image {number}") for number, image in enumerate(listed)]
        reliefs = [_relief(image) if heights else None for image in listed]
        raised = any(relief is not None for relief in reliefs)
        shining = materials and any(hasattr(image, "surface_texels") for image in listed)
        sizes = np.array([image.shape[1::-1] for image in pixels], np.int32).reshape(-1, 2)
        counts = sizes.prod(axis=1)
        count = EMISSIONS + 1 if shining else SURFACES + 1 if raised else COLORS + 1
        layers = np.zeros((count, counts.sum(), 4), np.float32)
        starts = np.cumsum(counts) - counts
        for image, own, relief, first in zip(listed, pixels, reliefs, starts.tolist(), strict=True):
            part = layers[:, first : first + own.shape[0] * own.shape[1]].reshape(count, *own.shape[:2], 4)
            if shining and hasattr(image, "surface_texels"):
                _write_maps(image, part)
                part *= unit_levels(own[..., 3:])
            part[COLORS] = linear_premultiplied(own)
            if relief is not None:
                part[SURFACES, ..., 3] = relief
        texels: Any = ImageTexels()
        extents = np.column_stack([starts, sizes]).astype(np.int32)
        texels.extents = wp.array(extents, dtype=wp.vec3i, device=device)
        texels.layers = wp.array(layers, dtype=wp.vec4, device=device)
        return cls(texels, raised, shining)

    def check(self, count: int) -> None:
        """Raise InvalidImage if there are fewer images than decals refer to."""
        if len(self.texels.extents) < count:
            raise InvalidImage(
                f"images: expected {count} or more, got {len(self.texels.extents)}; "
                "decals refer to them by number"
            )

    def sums(self, count: int, device: Any) -> Any:
        """Return an `ImageSums` for so many points."""
        sums: Any = ImageSums()
        sums.color = wp.zeros(count, dtype=wp.vec4, device=device)
        if self.raised or self.shining:
            sums.surface = wp.zeros(count, dtype=wp.vec4, device=device)
        if self.shining:
            sums.normal = wp.zeros(count, dtype=wp.vec3, device=device)
            sums.emission = wp.zeros(count, dtype=wp.vec4, device=device)
        return sums

    def samples(self, sums: Any) -> dict[str, Any]:
        """Return the fields of `Samples` that sums hold."""
        found: dict[str, Any] = {"color": sums.color}
        if self.raised:
            found["height"] = sums.surface.numpy()[:, 3]
        if self.shining:
            surface, emission = sums.surface.numpy(), sums.emission.numpy()
            found["materials"] = MaterialSamples(
                part=emission[:, 3],
                normal=sums.normal.numpy(),
                roughness=surface[:, 0],
                metallic=surface[:, 1],
                occlusion=surface[:, 2],
                emission=emission[:, :3],
            )
        return found


def _relief(image: Any) -> Float32Array | None:
    relief: Float32Array | None = image.relief_texels() if hasattr(image, "relief_texels") else None
    return relief


def _write_maps(image: Any, layers: Float32Array) -> None:
    """Write the maps of a material to layers ``float32[k, h, w, 4]``."""
    first, second = image.surface_texels()
    layers[SURFACES, ..., :2], layers[SURFACES, ..., 2] = first[..., 2:], second[..., 3]
    layers[NORMALS, ..., :2] = first[..., :2]
    layers[NORMALS, ..., 2] = np.sqrt(np.maximum(1.0 - (first[..., :2] ** 2).sum(axis=-1), 0.0))
    layers[EMISSIONS, ..., :3], layers[EMISSIONS, ..., 3] = second[..., :3], 1.0
