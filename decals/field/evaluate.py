"""`evaluate`: decals at surface points, without graphics, for baking, experiments and tests."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array, Int32Array
from blobtree.device import array_on, known_device, launch
from blobtree.validation import describe, truth
from decals.errors import InvalidDecals, InvalidScene
from decals.field.extras import ANSWERS
from decals.field.image_texels import MaterialSamples, UploadedImages
from decals.field.mapping import ImageMapping
from decals.field.points import checked_rows, checked_turns, device_of, placed, rows_on
from decals.field.query import Neighbors, Query, SingleTarget, image_count, rows_of, zeros
from decals.field.rules import AnyContact, PictureRules, with_law
from decals.field.sampling_kernels import sample_images
from decals.images.load import AnyImage
from decals.index.editor import RECORDS, DecalEditor
from decals.index.index import DecalIndex, index_on
from decals.model import Decals
from decals.receivers import mask_on, takes_named_only
from decals.record import DEFAULT_CONTACT, DEFAULT_STIFFNESS, RECORD


@runtime_checkable
class ImageWalks(Protocol):
    """Walks of decals, such as `decals.field.walks.Walks`."""

    @property
    def texels(self) -> Float32Array: ...  # noqa: D102
    def __len__(self) -> int: ...


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
    walks: ImageWalks | None = None,
    device: Any = None,
) -> Samples:
    """Evaluate decals at surface points: owner, image coordinates, field and colour.

    Parameters
    ----------
    decals : Decals or DecalEditor
        n decals. The owners of an editor's decals are its numbers.
    points : float32[m, 3]
        Surface points in model units. A point that is not finite has no owner. Arrays of Warp, and arrays of
        other libraries on a CUDA device (torch, CuPy, JAX), stay on their device.
    normals : float32[m, 3]
        Geometric normals of the surface there, of any length, where the points are. A zero normal faces every
        decal.
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
        Warp device. Default: that of points that stay on it, else Warp's default device.

    Returns
    -------
    Samples
        One row for each point. Its arrays are those of NumPy; for points that stay on their device they are
        Warp arrays there. ``from_dlpack`` of torch, CuPy and JAX takes either without a copy.

    Raises
    ------
    InvalidPoints
        Points and normals are not two arrays of the same shape [m, 3] on one device, or the derivatives of
        the normals are not one of shape [m, 3, 3]. Arrays that stay on their device must be float32, with
        three adjacent numbers in each row.
    InvalidImage
        An image of another type or shape, or fewer images than the decals refer to.
    InvalidDecals
        No decals, or the index of others.
    InvalidScene
        An unknown mapping or contact mode, a stiffness out of range, ``on`` is neither object nor labels, or
        the mapping is WALKED without walks of these decals.
    InvalidDevice
        Warp has no such device, or the points stay on another one.

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
    rules = PictureRules(mapping=mapping, contact=contact, stiffness=stiffness)
    checked_truths(jacobian=jacobian, neighbors=neighbors, materials=materials)
    rows = checked_rows(points, normals)
    device = device_of(rows, device)
    turns = checked_turns(normal_derivatives, len(rows.points))
    indexed = _indexed(decals, index, rules, walks, device)
    _limit(indexed, decals, on, device)
    texels = None if images is None else UploadedImages.of(images, device, materials=materials)
    query = Query(SingleTarget(decals, indexed, device), *rows_on(device, rows), rules.contact, texels)
    samples = samples_of(query, texels, turns, jacobian=jacobian, neighbors=neighbors)
    shown: Samples = placed(samples, device, stay=rows.stay)
    return shown


def samples_of(
    query: Query,
    images: UploadedImages | None,
    normal_derivatives: Float64Array | None,
    *,
    jacobian: bool,
    neighbors: bool,
) -> Samples:
    """Return what `evaluate` returns, in arrays of NumPy and of the device; the arguments are checked."""
    return Samples(
        query.owners,
        query.uv,
        query.fields,
        jacobian=ANSWERS["jacobian"](query, normal_derivatives) if jacobian else None,
        neighbors=ANSWERS["neighbors"](query) if neighbors else None,
        **({} if images is None else images.samples(query.sums)),
    )


class ColorEvaluator:
    """Colours of the same decals at many sets of points: those of `evaluate`, without its other answers.

    Parameters
    ----------
    decals, images, index, walks
        See `evaluate`.
    rules : PictureRules
        Mapping, contact and stiffness.
    """

    def __init__(
        self,
        decals: Decals | DecalEditor,
        images: Iterable[AnyImage],
        rules: PictureRules,
        *,
        index: DecalIndex | None = None,
        walks: ImageWalks | None = None,
    ) -> None:
        self._decals, self._contact, self._device = decals, rules.contact, known_device(None)
        self._indexed = _indexed(decals, index, rules, walks, self._device)
        self._images = UploadedImages.of(images, self._device, heights=False, materials=False)
        self._images.check(image_count(rows_of(decals)))
        self._nothing = zeros(self._device, 0, wp.int32, wp.vec2, wp.float32)

    def at(
        self, points: Float32Array, normals: Float32Array, on: object | str | Iterable[str] | None = None
    ) -> Float32Array:
        """Return colours ``float32[m, 4]``, linear and premultiplied; arguments are those of `evaluate`."""
        at, facing = (array_on(self._device, of, wp.vec3) for of in (points, normals))
        result: Float32Array = self.on_device(at, facing, on).numpy()
        return result

    def on_device(self, points: Any, normals: Any, on: object | str | Iterable[str] | None = None) -> Any:
        """Return what `at` returns, for arrays of Warp on the device of the evaluator."""
        _limit(self._indexed, self._decals, on, self._device)
        sums = self._images.sums(len(points), self._device)
        inputs = [points, normals, int(self._contact), self._indexed, *self._nothing, self._images.texels]
        launch(with_law(sample_images, self._contact), len(points), inputs, [sums], self._device)
        return sums.color


def checked_truths(**values: object) -> None:
    """Raise InvalidScene for a value that is neither True nor False."""
    for name, value in values.items():
        truth(name, value, InvalidScene)


def _indexed(
    decals: Decals | DecalEditor,
    index: DecalIndex | None,
    rules: PictureRules,
    walks: ImageWalks | None,
    device: Any,
) -> Any:
    """Return decals with their index and their rules on a device, an `IndexedDecals`."""
    indexed = _bare_indexed(decals, index, device)
    rules.apply(indexed)
    if rules.walked:
        texels = walk_texels(walks, len(indexed.records) // RECORD)
        indexed.walked, indexed.walks = True, wp.array(texels, dtype=wp.vec4, device=device)
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


def walk_texels(walks: ImageWalks | None, count: int) -> Float32Array:
    """Return the texels of walks of so many decals."""
    if not isinstance(walks, ImageWalks) or len(walks) != count:
        got = f"those of {len(walks)} decals" if isinstance(walks, ImageWalks) else describe(walks)
        raise InvalidScene(
            f"walks: expected walks of these {count} decals for the mapping WALKED, got {got}; "
            "decals.field.Walks.over(decals, [surface]) makes them"
        )
    return walks.texels


def _limit(
    indexed: Any, decals: Decals | DecalEditor, on: object | str | Iterable[str] | None, device: Any
) -> None:
    """Give indexed decals their limits, if they have any, and the mask of the surface that they lie on."""
    mask = mask_on(on, decals.receiver_table, InvalidScene)
    indexed.limited = decals.limited or takes_named_only(on)
    if indexed.limited:
        indexed.limits, indexed.surface = wp.array(decals.limits, dtype=wp.vec4, device=device), mask
