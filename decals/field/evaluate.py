"""`evaluate`: decals at surface points, without graphics, for baking, experiments and tests."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.device import known_device, launch
from blobtree.validation import real, truth
from decals.errors import InvalidDecals, InvalidImage, InvalidPoints, InvalidScene
from decals.field.jacobian import image_jacobians
from decals.field.law import AnyContact, ContactLaw, contact_mode
from decals.field.mapping import ImageMapping
from decals.field.sampling_kernels import color_points, sample_points
from decals.field.walks import Walks
from decals.images.load import AnyImage, each_image, image_pixels
from decals.images.texels import Pixels, linear_premultiplied, unit_levels
from decals.index.editor import RECORDS, DecalEditor
from decals.index.index import DecalIndex, index_on
from decals.model import NO_IMAGE, Decals
from decals.receivers import mask_on, takes_named_only
from decals.record import DEFAULT_CONTACT, DEFAULT_STIFFNESS, NEIGHBOR_REACH, RECORD, RIM_RADIUS
from decals.validation import describe, member, stiffness_number


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
    """

    offsets: Int64Array
    decals: Int32Array
    fields: Float32Array
    pushes: Float32Array


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
class Samples:
    """Decals at m points, as `evaluate` returns them.

    Attributes
    ----------
    owner : int32[m]
        Number of the topmost decal that shows at each point; −1 outside all rims.
    uv : float32[m, 2]
        Image coordinates in the owner's image, which is the disc of radius ½ around (½, ½). Outside the disc
        the owner shows nothing. 0 without owner.
    field : float32[m]
        F after contact (paper, equation 5): 1 at the centre, ½ on rims and contact lines. 0 without owner.
    color : float32[m, 4] or None
        Colour of all decals over each other, linear with premultiplied alpha. None without images.
    height : float32[m] or None
        Height of the relief above the surface in model units: heights of all decals over each other, mixed as
        their colours are. None without a `DecalMaterial` with relief.
    jacobian : float64[m, 2, 3] or None
        Derivative of `uv` by the point along the surface: the gradients of u and v, in the tangent plane.
        NaN without an owner. None if it was not asked for.
    neighbors : Neighbors or None
        All decals that act at each point, and their pushes. None if they were not asked for.
    materials : MaterialSamples or None
        Maps of materials. None if they were not asked for, or without a `DecalMaterial`.
    """

    owner: Int32Array
    uv: Float32Array
    field: Float32Array
    color: Float32Array | None = None
    jacobian: Float64Array | None = None
    neighbors: Neighbors | None = None
    height: Float32Array | None = None
    materials: MaterialSamples | None = None


def evaluate(
    decals: Decals | DecalEditor,
    points: ArrayLike,
    normals: ArrayLike,
    *,
    mapping: ImageMapping | str = ImageMapping.CORRECTED,
    contact: AnyContact | str = DEFAULT_CONTACT,
    stiffness: float = DEFAULT_STIFFNESS,
    index: DecalIndex | None = None,
    images: AnyImage | Iterable[AnyImage] | None = None,
    jacobian: bool = False,
    normal_derivatives: ArrayLike | None = None,
    neighbors: bool = False,
    materials: bool = False,
    on: object | str | Iterable[str] | None = None,
    walks: Walks | None = None,
    device: Any = None,
) -> Samples:
    """Evaluate decals at surface points: owner, image coordinates, field and colour.

    Parameters
    ----------
    decals : Decals or DecalEditor
        n decals. The owners of an editor's decals are its numbers.
    points : float32[m, 3]
        Surface points in model units. A point that is not finite has no owner.
    normals : float32[m, 3]
        Geometric normals of the surface there, of any length. A zero normal faces every decal.
    mapping : ImageMapping or str, optional
        Image mapping: CORRECTED (default), CHORD or WALKED.
    contact : Contact, str or ContactLaw, optional
        Contact mode: ELASTIC (default), PRODUCT, MIN or RADIAL.
    stiffness : float, optional
        Stiffness of elastic contact, from 1: how close to contact lines images are compressed.
    index : DecalIndex, optional
        Index of these decals. Built if not given; an editor has its own.
    images : image or sequence of images, optional
        Images of any kind and size, see `decals.images.image_pixels`, for `Samples.color` and
        `Samples.height`.
    jacobian : bool, optional
        True also returns the derivative of the image coordinates, `Samples.jacobian`.
    normal_derivatives : float[m, 3, 3], optional
        Derivatives of the normals by the point, for the derivative on curved surface. By default it is flat.
    neighbors : bool, optional
        True also returns the fields and pushes of all decals, `Samples.neighbors`.
    materials : bool, optional
        True also returns the maps of the images that are a `DecalMaterial`, `Samples.materials`.
    on : object of a scene, str or sequence of str, optional
        The object that the points lie on, or its labels, so that only decals act that lie on it. By default
        all decals act.
    walks : Walks, optional
        Log maps around the decals over their surface, which the mapping WALKED needs.
    device : optional
        Warp device. Default: Warp's default device.

    Returns
    -------
    Samples
        One row for each point.

    Raises
    ------
    InvalidPoints
        Points and normals are not two arrays of the same shape [m, 3], or the derivatives of the normals are
        not one of shape [m, 3, 3].
    InvalidImage
        An image of another type or shape, or fewer images than the decals refer to.
    InvalidDecals
        No decals, or the index of others.
    InvalidScene
        An unknown mapping or contact mode, a stiffness out of range, ``on`` is neither object nor labels, or
        the mapping is WALKED without walks of these decals.
    InvalidDevice
        Warp has no such device.

    See Also
    --------
    render : pictures of a scene.

    Examples
    --------
    >>> import decals
    >>> disk = decals.Decals(positions=[[0, 0, 0]], normals=[[0, 0, 1]], tangents=[[1, 0, 0]], radii=[1])
    >>> samples = decals.evaluate(disk, [[0, 0, 0], [0.5, 0, 0], [2, 0, 0]], [[0, 0, 1]] * 3)
    >>> samples.owner
    array([ 0,  0, -1], dtype=int32)
    >>> samples.uv.round(2).tolist()
    [[0.5, 0.5], [0.75, 0.5], [0.0, 0.0]]
    >>> samples.field.round(2)
    array([1.  , 0.85, 0.  ], dtype=float32)
    >>> decals.evaluate(disk, [[0.5, 0, 0]], [[0, 0, 1]], jacobian=True).jacobian.round(2).tolist()
    [[[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]]]
    """
    mapping = member("mapping", mapping, ImageMapping, InvalidScene)
    contact = contact_mode(contact, InvalidScene)
    stiffness = stiffness_number(stiffness, InvalidScene)
    for name, value in (("jacobian", jacobian), ("neighbors", neighbors), ("materials", materials)):
        truth(name, value, InvalidScene)
    device = known_device(device)
    positions, facings = _as_rows("points", points), _as_rows("normals", normals)
    count = len(positions)
    if count != len(facings):
        raise InvalidPoints(f"normals: expected one for each of {count} points, got {len(facings)}")
    turns = None
    if normal_derivatives is not None:
        turns = _as_rows("normal_derivatives", normal_derivatives, (3, 3)).astype(np.float64)
        if len(turns) != count:
            raise InvalidPoints(
                f"normal_derivatives: expected one for each of {count} points, got {len(turns)}"
            )
    indexed = _indexed(decals, index, mapping, stiffness, walks, device)
    _limit(indexed, decals, on, device)
    query = _Query(decals, indexed, positions, facings, contact, device)
    color = height = maps = None
    if images is not None:
        listed = each_image(images)
        pixels = [image_pixels(image, name=f"image {number}") for number, image in enumerate(listed)]
        color = query.colors([linear_premultiplied(image) for image in pixels])
        reliefs = [image.relief_texels() if hasattr(image, "relief_texels") else None for image in listed]
        if any(relief is not None for relief in reliefs):
            height = query.heights(reliefs, pixels)
        if materials and any(hasattr(image, "surface_texels") for image in listed):
            maps = query.materials(listed, pixels)
    derivative = query.jacobians(turns) if jacobian else None
    near = query.neighbors() if neighbors else None
    return Samples(query.owners, query.uv, query.fields, color, derivative, near, height, maps)


class ColorEvaluator:
    """Colours of the same decals at many sets of points: those of `evaluate`, without its other answers.

    Parameters
    ----------
    decals, images, mapping, contact, stiffness, index, walks, device
        See `evaluate`.
    """

    def __init__(
        self,
        decals: Decals | DecalEditor,
        images: Iterable[AnyImage],
        *,
        mapping: ImageMapping = ImageMapping.CORRECTED,
        contact: AnyContact = DEFAULT_CONTACT,
        stiffness: float = DEFAULT_STIFFNESS,
        index: DecalIndex | None = None,
        walks: Walks | None = None,
        device: Any = None,
    ) -> None:
        self._decals, self._contact, self._device = decals, contact, known_device(device)
        self._indexed = _indexed(decals, index, mapping, stiffness, walks, self._device)
        pixels = [image_pixels(image, name=f"image {number}") for number, image in enumerate(images)]
        layers = [linear_premultiplied(image) for image in pixels]
        self._images = _image_arrays(decals, layers, self._device)
        self._nothing = _zeros(self._device, 0, wp.int32, wp.vec2)

    def at(
        self, points: Float32Array, normals: Float32Array, on: object | str | Iterable[str] | None = None
    ) -> Float32Array:
        """Return colours ``float32[m, 4]``, linear and premultiplied; arguments are those of `evaluate`."""
        _limit(self._indexed, self._decals, on, self._device)
        rows: list[Any] = [wp.array(of, dtype=wp.vec3, device=self._device) for of in (points, normals)]
        inputs = [*rows, int(self._contact), self._indexed, *self._nothing, *self._images]
        (colors,) = _zeros(self._device, len(points), wp.vec4)
        launch(_with_law(color_points, self._contact), len(points), inputs, [colors], self._device)
        result: Float32Array = colors.numpy()
        return result


class _Query:
    """Decals on a device that are evaluated at points, in a contact mode or law.

    Attributes
    ----------
    owners, uv, fields
        See `Samples`.
    """

    def __init__(
        self,
        decals: Decals | DecalEditor,
        indexed: Any,
        points: Float32Array,
        normals: Float32Array,
        contact: AnyContact,
        device: Any,
    ) -> None:
        self._decals, self._indexed, self._contact, self._device = decals, indexed, contact, device
        self._rows = _rows_of(decals)
        self._points, self._normals = points, normals
        self._inputs = self._inputs_at(points, normals)
        outputs = self._sample(self._inputs)
        self._shown: list[Any] = outputs[:2]
        self.owners, self.uv, self.fields = (array.numpy() for array in outputs)

    def _inputs_at(self, points: Float32Array, normals: Float32Array) -> list[Any]:
        arrays: list[Any] = [wp.array(rows, dtype=wp.vec3, device=self._device) for rows in (points, normals)]
        return [*arrays, int(self._contact), self._indexed]

    def _launch(self, kernel: Any, inputs: list[Any], outputs: list[Any]) -> None:
        launch(_with_law(kernel, self._contact), len(inputs[0]), inputs, outputs, self._device)

    def _sample(self, inputs: list[Any]) -> list[Any]:
        outputs = _zeros(self._device, len(inputs[0]), wp.int32, wp.vec2, wp.float32)
        self._launch(sample_points, inputs, outputs)
        return outputs

    def jacobians(self, normal_derivatives: Float64Array | None) -> Float64Array:
        """Return derivatives of image coordinates."""
        spheres: Float32Array = self._indexed.records.numpy()[::RECORD, 3]
        radii = np.ones(len(self._points))
        owned = self.owners >= 0
        radii[owned] = RIM_RADIUS * spheres[self.owners[owned]]

        def sampled(points: Float32Array, normals: Float32Array) -> tuple[Int32Array, Float32Array]:
            owner, uv, _ = self._sample(self._inputs_at(points, normals))
            return owner.numpy(), uv.numpy()

        center = self.owners, self.uv
        return image_jacobians(sampled, self._points, self._normals, radii, center, normal_derivatives)

    def neighbors(self) -> Neighbors:
        """Return all decals with a field at points; the index lists whole influences, not only reaches."""
        from decals.field.neighbor_kernels import list_neighbors  # compiled at the first use

        indexed, device, count = self._indexed, self._device, len(self._points)
        decals, rows = self._decals, self._rows
        known = decals.numbers if isinstance(decals, DecalEditor) else np.arange(len(rows))
        wide = index_on(rows, device, reach=1.0 / NEIGHBOR_REACH)
        wide.stiffness, wide.surface, wide.limited = indexed.stiffness, indexed.surface, indexed.limited
        if wide.limited:
            wide.limits = wp.array(rows.limits_of(decals.receiver_table), dtype=wp.vec4, device=device)
        kept = np.searchsorted(known, self.owners).astype(np.int32)
        empty = _zeros(device, 0, wp.int32, wp.float32)
        (counts,) = _zeros(device, count, wp.int32)
        placed: Any = wp.array(np.where(self.owners >= 0, kept, self.owners), dtype=wp.int32, device=device)
        given = [*self._inputs[:-1], wide, placed]
        self._launch(list_neighbors, [*given, empty[0]], [counts, empty[0], empty[1], empty[1]])
        offsets = np.concatenate([[0], np.cumsum(counts.numpy(), dtype=np.int64)])
        starts: Any = wp.array(offsets[:-1], dtype=wp.int32, device=device)
        total = int(offsets[-1])
        lists = _zeros(device, total, wp.int32, wp.float32, wp.float32)
        if total:
            self._launch(list_neighbors, [*given, starts], [counts, *lists])
        found, fields, pushes = (values.numpy() for values in lists)
        order = np.lexsort((found, np.repeat(np.arange(count), np.diff(offsets))))
        return Neighbors(offsets, known[found[order]].astype(np.int32), fields[order], pushes[order])

    def colors(self, layers: Sequence[Float32Array]) -> Float32Array:
        """Return the colours of images, linear and premultiplied, over each other."""
        (colors,) = _zeros(self._device, len(self._points), wp.vec4)
        images = _image_arrays(self._decals, layers, self._device)
        self._launch(color_points, [*self._inputs, *self._shown, *images], [colors])
        result: Float32Array = colors.numpy()
        return result

    def heights(self, reliefs: Sequence[Float32Array | None], pixels: Sequence[Pixels]) -> Float32Array:
        """Return heights in model units, mixed as a colour is, with the radius of each decal as its tint."""
        layers = []
        for relief, image in zip(reliefs, pixels, strict=True):
            layer = np.zeros(image.shape, np.float32)
            layer[..., 3] = unit_levels(image[..., 3])
            if relief is not None:
                layer[..., 0] = relief
            layers.append(layer)
        radii = RIM_RADIUS * self._indexed.records.numpy()[::RECORD, 3:]
        return self._map_sums(layers, np.repeat(radii, 3, axis=1))[:, 0]

    def materials(self, images: Sequence[Any], pixels: Sequence[Pixels]) -> MaterialSamples:
        """Return the maps of materials, mixed as colours are, with the axes of each decal as its tint."""
        given = []  # x, y, z of normals; roughness, metalness, 1; emission; occlusion
        for image, pixel in zip(images, pixels, strict=True):
            maps = np.zeros((*pixel.shape[:2], 12), np.float32)
            if hasattr(image, "surface_texels"):
                first, second = image.surface_texels()
                maps[..., :2], maps[..., 3:5] = first[..., :2], first[..., 2:]
                maps[..., 2] = np.sqrt(np.maximum(1.0 - (first[..., :2] ** 2).sum(axis=-1), 0.0))
                maps[..., 5], maps[..., 6:10] = 1.0, second
            alpha = unit_levels(pixel[..., 3:])
            given.append(np.concatenate([maps * alpha, alpha], axis=-1))

        def sums(columns: list[int], tints: Float32Array | float) -> Float32Array:
            layers = [np.ascontiguousarray(maps[..., [*columns, -1]]) for maps in given]
            return self._map_sums(layers, tints)[:, :3]

        records, normals = self._indexed.records.numpy(), self._normals
        facing, axis = records[1::RECORD, :3], records[2::RECORD, :3]
        tilt = sums([0, 0, 0], axis) + sums([1, 1, 1], np.cross(facing, axis))
        upright, roughness, metallic = sums([2, 3, 4], 1.0).T
        emission = sums([6, 7, 8], 1.0)
        part, occlusion, _ = sums([5, 9, 10], 1.0).T
        unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.float32(1e-30))
        owner_facing = facing[np.maximum(self.owners, 0)] if len(facing) else unit
        # turned as the normal is on the way to the point; the inverse of `unroll_step`
        cosine = np.maximum(1.0 + (owner_facing * unit).sum(axis=1, keepdims=True), 1e-4)
        turned = tilt - (tilt * unit).sum(axis=1, keepdims=True) / cosine * (owner_facing + unit)
        normal = (turned + upright[:, None] * unit).astype(np.float32)
        return MaterialSamples(part, normal, roughness, metallic, occlusion, emission)

    def _map_sums(self, layers: Sequence[Float32Array], tints: Float32Array | float) -> Float32Array:
        """Return layers ``[h, w, 4]`` mixed as colours are, with other tints; without image, decals add 0."""
        records = self._indexed.records
        tinted = records.numpy().copy()
        tinted[3::RECORD, :3] = np.where(tinted[2::RECORD, 3:] >= 0.0, tints, 0.0)
        self._indexed.records = wp.array(tinted, dtype=wp.vec4, device=self._device)
        try:
            return self.colors(layers)
        finally:
            self._indexed.records = records


def _with_law(kernel: Any, contact: AnyContact) -> Any:
    """Return a kernel for a contact mode, or with the formulas of a contact law."""
    return contact.formulas.kernel(kernel) if isinstance(contact, ContactLaw) else kernel


def _zeros(device: Any, count: int, *kinds: Any) -> list[Any]:
    return [wp.zeros(count, dtype=kind, device=device) for kind in kinds]


def _rows_of(decals: Decals | DecalEditor) -> Decals:
    return decals.decals if isinstance(decals, DecalEditor) else decals


def _image_arrays(
    decals: Decals | DecalEditor, layers: Sequence[Float32Array], device: Any
) -> tuple[Any, Any]:
    """Return images ``float32[h, w, 4]`` of decals on a device, row after row, the upper row first.

    Returns
    -------
    extents : vec3i[k]
        First texel, width and height of each image.
    texels : vec4[t]
    """
    min_count = int(_rows_of(decals).images.max(initial=NO_IMAGE)) + 1
    if len(layers) < min_count:
        raise InvalidImage(
            f"images: expected {min_count} or more, got {len(layers)}; decals refer to them by number"
        )
    sizes = np.array([(layer.shape[1], layer.shape[0]) for layer in layers], np.int32).reshape(-1, 2)
    counts = sizes.prod(axis=1)
    extents = np.column_stack([np.cumsum(counts) - counts, sizes]).astype(np.int32)
    texels = np.concatenate([np.zeros((0, 4), np.float32), *(layer.reshape(-1, 4) for layer in layers)])
    arrays: list[Any] = [
        wp.array(values, dtype=kind, device=device)
        for values, kind in ((extents, wp.vec3i), (texels, wp.vec4))
    ]
    return arrays[0], arrays[1]


def _indexed(
    decals: Decals | DecalEditor,
    index: DecalIndex | None,
    mapping: ImageMapping,
    stiffness: float,
    walks: Walks | None,
    device: Any,
) -> Any:
    """Return decals with their index and their modes on a device, an `IndexedDecals`."""
    indexed = _bare_indexed(decals, index, device)
    indexed.stiffness, indexed.mapping = stiffness, int(mapping)
    if mapping is ImageMapping.WALKED:
        indexed.walked, indexed.walks = True, _walk_texels(walks, len(indexed.records) // RECORD, device)
    return indexed


def _bare_indexed(decals: Decals | DecalEditor, index: DecalIndex | None, device: Any) -> Any:
    """Return decals with their index on a device, in the default modes."""
    if isinstance(decals, DecalEditor):
        records = decals.arrays[RECORDS]
        return decals.index.on(device, records=records, layered=decals.layered, copy=False)
    if not isinstance(decals, Decals):
        raise InvalidDecals(f"expected Decals or a DecalEditor, got {describe(decals)}; a scene has .decals")
    if index is None:
        return index_on(decals, device)
    if not isinstance(index, DecalIndex) or index.count != len(decals):
        got = f"one of {index.count}" if isinstance(index, DecalIndex) else describe(index)
        raise InvalidDecals(
            f"index: expected the index of these {len(decals)} decals, got {got}; DecalIndex.of makes it"
        )
    return index.on(device, records=decals.packed(), layered=decals.layered, copy=False)


def _walk_texels(walks: Walks | None, count: int, device: Any) -> Any:
    """Return the texels of walks of so many decals on a device."""
    if not isinstance(walks, Walks) or len(walks) != count:
        got = f"those of {len(walks)} decals" if isinstance(walks, Walks) else describe(walks)
        raise InvalidScene(
            f"walks: expected walks of these {count} decals for the mapping WALKED, got {got}; "
            "decals.field.Walks.over(decals, [surface]) makes them"
        )
    return wp.array(walks.texels, dtype=wp.vec4, device=device)


def _limit(
    indexed: Any, decals: Decals | DecalEditor, on: object | str | Iterable[str] | None, device: Any
) -> None:
    """Give indexed decals their limits, if they have any, and the mask of the surface that they lie on."""
    mask = mask_on(on, decals.receiver_table, InvalidScene)
    indexed.limited = decals.limited or takes_named_only(on)
    if indexed.limited:
        indexed.limits, indexed.surface = wp.array(decals.limits, dtype=wp.vec4, device=device), mask


def _as_rows(name: str, values: ArrayLike, shape: tuple[int, ...] = (3,)) -> Float32Array:
    expected = ", ".join(map(str, ("m", *shape)))
    try:
        with np.errstate(over="ignore"):
            array = np.asarray(real(values), np.float32)
    except (TypeError, ValueError, OverflowError):
        raise InvalidPoints(
            f"{name}: expected numbers of shape [{expected}], got {describe(values)}"
        ) from None
    if array.shape[1:] != shape:
        raise InvalidPoints(
            f"{name}: expected shape [{expected}], got {list(array.shape)}; give one row per point"
        )
    return array
