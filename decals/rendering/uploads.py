"""Scenes on the GPU: the drawables of objects, the decals' records and index, images, and their caches."""

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from blobtree._typing import Float32Array, Int64Array, UInt8Array
from blobtree.transpile.glsl import TEXTURE_WIDTH_BITS
from decals.errors import InvalidScene, TooMuchData
from decals.field.mapping import ImageMapping
from decals.field.walks import Walks
from decals.images.texels import Pixels, linear_premultiplied, resized_texels
from decals.index.editor import LIMITS, RECORDS, DecalEditor
from decals.index.index import DecalIndex, has_nested
from decals.model import Decals
from decals.receivers import object_mask
from decals.rendering.context import Context
from decals.rendering.environment import Environment
from decals.rendering.gbuffer import GBuffer
from decals.rendering.light_pass import EnvironmentTextures
from decals.rendering.materials import (
    RELIEF_LOOKUPS,
    MaterialArray,
    Relief,
    ReliefArray,
    has_materials,
    has_relief,
)
from decals.rendering.options import Drawing, SceneLike, check_scene, drawn_objects, is_limited
from decals.rendering.pixel_pass import Program, set_uniform
from decals.rendering.viewpoint import WHOLE, Bounds, Part, Tile
from decals.rendering.walk_cache import WalkCache
from decals.rendering.warmup import WarmupPlan
from decals.validation import require_rgba

MAX_IMAGE_BYTES = 1 << 29
"""Memory of all images without mip levels, at most; for more, all become smaller."""
_TEXEL_BYTES = 8  # four half floats

Texels = TypeVar("Texels", UInt8Array, Float32Array)


class ImageArray:
    """Images for one shader: layer ``i`` is image ``i``, its first row at v = 1.

    Images are converted to linear light with premultiplied alpha in half floats, so filtering and
    compositing are sums. All layers have one width and one height, with mip levels. An empty list gives
    one transparent layer.

    Attributes
    ----------
    width, height : int
        Texels of a layer.
    texture : moderngl.TextureArray
        The layers.

    Raises
    ------
    InvalidImage
        If an array is no image, see `decals.images.texels.Pixels`.
    """

    def __init__(self, context: Context, images: Sequence[Pixels]) -> None:
        for number, image in enumerate(images):
            require_rgba(f"image {number}", image)
        shapes = [(image.shape[0], image.shape[1]) for image in images]
        self.height, self.width = common_shape(shapes, limit=context.max_texture_size)
        layers = len(images) or 1
        self.texture = context.gl.texture_array((self.width, self.height, layers), 4, dtype="f2")
        empty = np.zeros((1, 1, 4), np.uint8)
        for layer, image in enumerate(images or [empty]):
            texels = _texels(image, (self.height, self.width))[::-1]
            region = (0, 0, layer, self.width, self.height, 1)
            self.texture.write(texels.astype(np.float16).tobytes(), viewport=region)
        self.texture.repeat_x = self.texture.repeat_y = False
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        if max(self.height, self.width) > 1:  # the first mip levels of a context cost llvmpipe 70 ms
            self.texture.build_mipmaps()
            self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.texture.anisotropy = context.anisotropy

    def use(self, unit: int) -> None:
        """Bind the array to a unit."""
        self.texture.use(unit)

    def release(self) -> None:
        """Release the memory."""
        self.texture.release()


def common_shape(shapes: Sequence[tuple[int, int]], *, limit: int) -> tuple[int, int]:
    """Return powers of two from the largest height and width upward, within the limits of size and memory."""
    height, width = (
        min(1 << (max(sides, default=1) - 1).bit_length(), 1 << (limit.bit_length() - 1))
        for sides in ([shape[axis] for shape in shapes] for axis in (0, 1))
    )
    while len(shapes) * height * width * _TEXEL_BYTES > MAX_IMAGE_BYTES:
        if height >= width:
            height //= 2
        else:
            width //= 2
    return height, width


def _texels(image: Pixels, shape: tuple[int, int]) -> Float32Array:
    """Return an image in linear light and another shape, with colours around its disc."""
    if image.dtype == np.uint8:
        return linear_premultiplied(filled_corners(resized(image.astype(np.uint8, copy=False), shape)))
    return resized_texels(filled_corners(linear_premultiplied(image)), shape)


def resized(image: UInt8Array, shape: tuple[int, int]) -> UInt8Array:
    """Return an image in another shape, colours weighted by alpha so that hidden colours do not show."""
    if image.shape[:2] == shape:
        return image
    picture = Image.fromarray(np.ascontiguousarray(image))
    return np.asarray(picture.resize(shape[::-1], Image.Resampling.LANCZOS))


DISC_MARGIN = 1.5
"""Texels around the disc of an image that bilinear look-ups inside it may read."""


def filled_corners(image: Texels) -> Texels:
    """Return an image whose texels outside its disc continue its rim outward.

    Decals show the disc alone, but mip levels average texels on both sides of its rim.
    """
    height, width = image.shape[:2]
    y = (np.arange(height, dtype=np.float32) + 0.5)[:, None] - 0.5 * height
    x = (np.arange(width, dtype=np.float32) + 0.5) - 0.5 * width
    distance = np.hypot(2.0 * x / width, 2.0 * y / height)
    outside = np.nonzero(distance > 1.0 + 2.0 * DISC_MARGIN / min(height, width))
    if not len(outside[0]):
        return image
    filled = image.copy()
    shrink = (1.0 - 1.0 / min(height, width)) / distance[outside]
    row = (0.5 * height + y[outside[0], 0] * shrink).astype(np.intp)
    column = (0.5 * width + x[outside[1]] * shrink).astype(np.intp)
    filled[outside] = image[row, column]
    return filled


ROW_TEXELS = 1 << TEXTURE_WIDTH_BITS
"""Texels in a row of a data texture; 16,384 rows, a usual limit, hold 67 million elements."""

_TEXTURE_KINDS = {
    (np.dtype(np.float32), (4,)): "f4",
    (np.dtype(np.int32), ()): "i4",
    (np.dtype(np.int32), (4,)): "i4",
}


STORED = ("decal_records", "index_levels", "index_table", "index_ids")
"""Arrays that storage buffers hold too, bound from 1 on, for compute shaders with many look-ups a pixel."""


def stored(library: str) -> str:
    """Return GLSL of decal formulas that reads storage buffers, by functions of ``decal_data.glsl``."""
    for name in STORED:
        library = library.replace(f"texelFetch({name}, ", f"fetch_{name}(")
    return library


class DataTexture:
    """A ``float32[n, 4]``, ``int32[n]`` or ``int32[n, 4]`` array as a texture.

    Parameters
    ----------
    context
        Where the texture lives.
    array
        Its contents; an empty array takes one row of zeros, because no texture has size 0.

    Raises
    ------
    ValueError
        If the array has another shape or type.
    TooMuchData
        If the array has more elements than a texture on this GPU.
    """

    def __init__(self, context: Context, array: NDArray[Any]) -> None:
        components, dtype = _kind(array)
        rows = max(1, -(-len(array) // ROW_TEXELS))
        if rows > context.max_texture_size:
            raise TooMuchData(
                f"{len(array):,} elements do not fit into one texture here; expected at most "
                f"{context.max_texture_size * ROW_TEXELS:,}; take fewer decals or a smaller tree"
            )
        self.count = len(array)
        self.texture = context.gl.texture(
            (ROW_TEXELS, rows), components, _rows(array, rows, components), dtype=dtype
        )
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._shape, self._kind = array.shape[1:], array.dtype
        self._gl = context.gl
        self._buffer: moderngl.Buffer | None = None

    def read(self) -> NDArray[Any]:
        """Read the array back: the same shape, type and bits."""
        flat = np.frombuffer(self.texture.read(), self._kind)
        return flat[: self.count * math.prod(self._shape)].reshape(-1, *self._shape)

    def write(self, first: int, array: NDArray[Any]) -> None:
        """Overwrite the elements from ``first`` on; only their bytes are uploaded."""
        done = 0
        while done < len(array):
            x, y = (first + done) % ROW_TEXELS, (first + done) // ROW_TEXELS
            left = len(array) - done
            whole_rows = x == 0 and left >= ROW_TEXELS
            width, height = (ROW_TEXELS, left // ROW_TEXELS) if whole_rows else (min(ROW_TEXELS - x, left), 1)
            part = np.ascontiguousarray(array[done : done + width * height], self._kind)
            self.texture.write(part, viewport=(x, y, width, height))
            if self._buffer is not None:
                self._buffer.write(part, (first + done) * part[0].nbytes)
            done += width * height

    def use(self, unit: int) -> None:
        """Bind the texture to a unit."""
        self.texture.use(unit)

    def store(self, binding: int) -> None:
        """Bind a storage buffer with the same contents; the first call makes it."""
        if self._buffer is None:
            self._buffer = self._gl.buffer(self.texture.read())
        self._buffer.bind_to_storage_buffer(binding)

    def release(self) -> None:
        """Release the memory."""
        self.texture.release()
        if self._buffer is not None:
            self._buffer.release()


def _kind(array: NDArray[Any]) -> tuple[int, str]:
    """Return the components of a texel, and their moderngl type."""
    kind = _TEXTURE_KINDS.get((array.dtype, array.shape[1:]))
    if kind is None or not array.ndim:
        raise ValueError(
            f"expected float32[n, 4], int32[n] or int32[n, 4], got {array.dtype}{list(array.shape)}"
        )
    return math.prod(array.shape[1:]), kind


def _rows(array: NDArray[Any], rows: int, components: int) -> NDArray[Any]:
    padded = np.zeros(rows * ROW_TEXELS * components, array.dtype)
    padded[: array.size] = array.reshape(-1)
    return padded


WALKS_PER_CANDIDATE = 8
"""Greatest number of walks over all candidates of a pixel."""

SEARCH_OVERHEAD = 3
"""Iterations of a binary search besides its halvings."""


class LoopLimit:
    """The greatest number of loop iterations that a driver allows a pixel; None for no limit.

    Measuring the lists of an index takes as long as many edits. A result therefore stays valid for as many
    versions as cannot reach the limit: each edit adds at most one entry to a list.
    """

    def __init__(self, max_iterations: int | None) -> None:
        self._max_iterations = max_iterations
        self._table = np.zeros((0, 4), np.int32)
        self._shape = (0, False)
        self._valid_until = 0

    def check(self, index: DecalIndex, *, layered: bool, version: int = 0) -> None:
        """Raise TooMuchData if an index needs more iterations; ``version`` counts its edits."""
        shape = index.level_count, layered
        valid = index.table is self._table and shape == self._shape and version <= self._valid_until
        if self._max_iterations is None or valid:
            return
        lengths = index.longest_lists
        candidates, allowed = (
            int(lengths.sum()),
            self._max_iterations // _iterations(lengths, layered=layered),
        )
        if candidates > allowed:
            raise TooMuchData(
                f"{candidates:,} decals reach the same place; expected at most {allowed:,}: "
                "software rendering cuts off the rest; spread them, draw on a graphics card, or use evaluate"
            )
        spare = allowed - candidates
        while (
            spare
            and _iterations(lengths + spare, layered=layered) * (candidates + spare) > self._max_iterations
        ):
            spare //= 2
        self._table, self._shape, self._valid_until = index.table, shape, version + spare


def _iterations(lengths: Int64Array, *, layered: bool) -> int:
    """Return the iterations for each candidate; with layers, each candidate takes a search in every list."""
    searches = sum(int(length).bit_length() + SEARCH_OVERHEAD for length in lengths)
    return WALKS_PER_CANDIDATE + searches * layered


class DecalData:
    """Records and index of a set of decals, as ``shaders/decals.glsl`` reads them.

    ``lookups`` is the number of points that are looked up for a pixel; ``version`` is that of an editor.
    """

    def __init__(
        self, context: Context, decals: Decals | DecalEditor, *, limited: bool = False, lookups: int = 1
    ) -> None:
        self._context = context
        self.limited = limited
        self.version = 0
        iterations = context.max_loop_iterations
        self._loop_limit = LoopLimit(None if iterations is None else iterations // lookups)
        if isinstance(decals, DecalEditor):
            self.version = decals.version
            arrays, index = decals.arrays, decals.index
        else:
            index = DecalIndex.of(decals)
            arrays = {
                RECORDS: decals.packed(),
                LIMITS: decals.limits,
                "index_levels": index.levels,
                "index_table": index.table,
                "index_ids": index.ids,
            }
            indexed = index.on("cpu", records=arrays[RECORDS], layered=decals.layered, copy=False)
            self.nested = has_nested(indexed, len(decals))
        self._loop_limit.check(index, layered=decals.layered, version=self.version)
        self._textures = {
            name: DataTexture(context, array) for name, array in arrays.items() if limited or name != LIMITS
        }
        self._read_uniforms(decals, index)

    def _read_uniforms(self, decals: Decals | DecalEditor, index: DecalIndex) -> None:
        self.layered = decals.layered
        if isinstance(decals, DecalEditor):
            self.nested = decals.nested
        self._uniforms = {"index_level_count": index.level_count, "index_mask": index.mask}

    def update(self, editor: DecalEditor) -> int:
        """Upload the changes of an editor since the last call; return the number of bytes.

        The data must have been made of the same editor. Several data may follow one editor.

        Raises
        ------
        TooMuchData
            If more decals reach one point than the driver allows; nothing is uploaded.
        """
        index = editor.index
        self._loop_limit.check(index, layered=editor.layered, version=editor.version)
        byte_count, since, self.version = 0, self.version, editor.version
        for name, ranges in editor.changed_rows(since).items():
            if name not in self._textures:
                continue
            array = editor.arrays[name]
            if self._textures[name].count != len(array):
                self._textures[name].release()
                self._textures[name] = DataTexture(self._context, array)
                byte_count += array.nbytes
                continue
            for first, end in ranges:
                self._textures[name].write(first, array[first:end])
                byte_count += array[first:end].nbytes
        self._read_uniforms(editor, index)
        return byte_count

    @property
    def texture_count(self) -> int:
        """Number of textures."""
        return len(self._textures)

    def use(self, program: Program, first_unit: int) -> None:
        """Bind all textures to the units from ``first_unit`` on, and set the uniforms of a program."""
        units = range(first_unit, first_unit + len(self._textures))
        for name, value in self.bind(units).items():
            set_uniform(program, name, value)

    def store(self) -> None:
        """Bind the storage buffers `STORED`."""
        for binding, name in enumerate(STORED, 1):
            self._textures[name].store(binding)

    def bind(self, units: Sequence[int]) -> dict[str, int]:
        """Bind the textures to `texture_count` units; return the uniforms of a program by their names."""
        samplers = dict(zip(self._textures, units, strict=True))
        for name, unit in samplers.items():
            self._textures[name].use(unit)
        return samplers | self._uniforms

    def release(self) -> None:
        """Release the memory."""
        for texture in self._textures.values():
            texture.release()


class Drawable(Protocol):
    """One object of the scene on the GPU; it owns its handles.

    Examples
    --------
    Annotate a factory for `register`:

    >>> import pyvista
    >>> from decals.rendering import Context, Drawable
    >>> from decals.rendering.mesh import MeshDrawable
    >>> from decals.scenes.objects import as_object
    >>> def draw_cube(context: Context, item: object) -> Drawable:
    ...     return MeshDrawable(context, as_object(pyvista.Cube(), "cube"))
    """

    @property
    def bounds(self) -> Bounds:
        """Box around everything that `draw` can draw."""
        ...

    @property
    def rasterised(self) -> bool:
        """True if `draw` uses the depth test; all other drawables are drawn after those that do."""
        ...

    def draw(self, object_id: int, tile: Tile, gbuffer: GBuffer, part: Part = WHOLE) -> None:
        """Put the object, or a part of it, into the G-buffer wherever it is nearer than the surface there.

        The tile's camera is bound already, see `attach_camera`. A rasterised object is written by
        ``write_surface`` of ``shaders/gbuffer.glsl``, with true depth. Any other writes to the textures and
        leaves the depth unchanged; `GBuffer.complete_depth` adds it. OpenGL state other than that of
        `GBuffer.use` must be restored. Each call must draw the same: the renderer leaves it out for targets
        that hold the same objects.
        """
        ...

    def release(self) -> None:
        """Release the memory."""
        ...


Factory = Callable[[Context, Any], Drawable]
WarmupFactory = Callable[[Context, Any], WarmupPlan]

_DRAWABLE_KINDS: dict[type, tuple[Factory, WarmupFactory]] = {}


def _no_warmup(_context: Context, item: object) -> WarmupPlan:
    return WarmupPlan(repr(type(item)), ())


def register(kind: type, factory: Factory, warmup: WarmupFactory = _no_warmup) -> None:
    """Draw objects of a type by ``factory(context, object)``, a `Drawable`.

    Parameters
    ----------
    kind : type
        A class, also for its subclasses; or a runtime-checkable protocol, for objects of no registered class.
    factory : callable
        Function of the context and the object that returns its `Drawable`.
    warmup : callable, optional
        Function of the same arguments that returns the `WarmupPlan` of the drawable.

    Examples
    --------
    Draw dice as cubes:

    >>> import pyvista
    >>> from decals.rendering import register
    >>> from decals.rendering.mesh import MeshDrawable
    >>> from decals.scenes.objects import as_object
    >>> class Die: ...
    >>> register(Die, lambda context, die: MeshDrawable(context, as_object(pyvista.Cube(), "die")))
    """
    _DRAWABLE_KINDS[kind] = factory, warmup


def drawable_for(context: Context, item: object) -> Drawable:
    """Return the drawable of a scene's object.

    Raises
    ------
    InvalidScene
        If no factory was registered for its type.
    """
    return _kind_of(item)[0](context, item)


def warmup_of(context: Context, item: object) -> WarmupPlan:
    """Return the warm-up plan of a scene's object; errors are those of `drawable_for`."""
    return _kind_of(item)[1](context, item)


def _kind_of(item: object) -> tuple[Factory, WarmupFactory]:
    for kind in type(item).__mro__:
        if kind in _DRAWABLE_KINDS:
            return _DRAWABLE_KINDS[kind]
    for kind, factories in _DRAWABLE_KINDS.items():
        if getattr(kind, "_is_protocol", False) and isinstance(item, kind):
            return factories
    raise InvalidScene(
        f"cannot draw a {type(item).__name__}; expected a MeshObject, a TreeObject "
        "or an object of a type given to decals.rendering.register"
    )


class Releasable(Protocol):
    """A resource on the GPU."""

    def release(self) -> None:
        """Release the memory."""
        ...


Resource = TypeVar("Resource", bound=Releasable)


class GpuCache(Generic[Resource]):
    """Resources on the GPU, each made once for the (immutable) objects that it represents.

    Objects are compared by identity, and kept alive as long as their resources.
    """

    def __init__(self) -> None:
        self._entries: dict[Hashable, tuple[tuple[object, ...], Resource]] = {}
        self._used: set[Hashable] = set()

    def get(self, make: Callable[[], Resource], *objects: object) -> Resource:
        """Return the resource of these objects; make it at the first call."""
        key = tuple(id(item) for item in objects)
        if key not in self._entries:
            self._entries[key] = objects, make()
        self._used.add(key)
        return self._entries[key][1]

    def find(self, *objects: object) -> Resource | None:
        """Return the resource of these objects, or None before the first call of `get`."""
        return self._entries.get(tuple(id(item) for item in objects), (None, None))[1]

    def sweep(self) -> None:
        """Release the resources that `get` did not return since the last sweep."""
        for key in set(self._entries) - self._used:
            self._entries.pop(key)[1].release()
        self._used.clear()

    def release(self) -> None:
        """Release everything."""
        self._used.clear()
        self.sweep()


@dataclass(frozen=True, eq=False)
class UploadedScene:
    """A scene on the GPU."""

    drawables: list[Drawable]
    decals: DecalData | None
    images: ImageArray | None
    masks: DataTexture | None = None
    materials: MaterialArray | None = None
    relief: Relief | None = None
    walks: DataTexture | None = None
    environment: EnvironmentTextures | None = None

    @cached_property
    def bounds(self) -> Bounds:
        """Box around all objects; a point for a scene without objects."""
        if not self.drawables:
            return np.zeros(3), np.zeros(3)
        boxes = []
        for drawable in self.drawables:
            lower, upper = (np.asarray(corner) for corner in drawable.bounds)
            growth = self.relief.reach if self.relief is not None and self.moves(drawable) else 0.0
            boxes.append((lower - growth, upper + growth))
        lowest, highest = zip(*boxes, strict=True)
        return np.min(lowest, axis=0), np.max(highest, axis=0)

    def moves(self, drawable: Drawable) -> bool:
        """Return True if heights of decals move the surface of an object."""
        return self.relief is not None and hasattr(drawable, "draw_offset")


class Uploads:
    """Objects, decals and images of scenes on the GPU; they stay until a `sweep` after which they are unused.

    The context must be current.

    Attributes
    ----------
    walk_cache
        The walks of the last scene in the mapping WALKED.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self._drawables: GpuCache[Drawable] = GpuCache()
        self._decals: GpuCache[DecalData] = GpuCache()
        self._images: GpuCache[ImageArray] = GpuCache()
        self._materials: GpuCache[MaterialArray] = GpuCache()
        self._reliefs: GpuCache[ReliefArray] = GpuCache()
        self._environments: GpuCache[EnvironmentTextures] = GpuCache()
        self._caches: tuple[GpuCache[Any], ...] = (
            self._drawables,
            self._decals,
            self._images,
            self._materials,
            self._reliefs,
            self._environments,
        )
        self._masks: tuple[tuple[int, ...], DataTexture] | None = None
        self._relief: tuple[ReliefArray, DecalData, int, Relief] | None = None
        self.walk_cache = WalkCache()
        self._walks: tuple[Walks, DataTexture] | None = None

    def scene(self, scene: SceneLike, drawing: Drawing) -> UploadedScene:
        """Return a whole scene, with what a way of drawing needs; errors are those of `check_scene`."""
        check_scene(scene)
        objects = drawn_objects(scene)
        drawables = [self.drawable(item) for item in objects]
        masks = self._masks_of(scene, objects)
        images = self.images(scene)
        materials = self._materials_of(scene, images)
        relief, walks = self._relief_of(scene, images), self.walks(scene, drawing.mapping)
        environment = self.environment(drawing.environment)
        decals = self.decals(scene)
        return UploadedScene(drawables, decals, images, masks, materials, relief, walks, environment)

    def environment(self, environment: Environment | None) -> EnvironmentTextures | None:
        """Return the textures of an environment."""
        if environment is None:
            return None
        panorama, visible = environment.picture, environment.visible
        return self._environments.get(
            lambda: EnvironmentTextures(self.context, panorama, visible), panorama, visible
        )

    def walks(self, scene: SceneLike, mapping: ImageMapping) -> DataTexture | None:
        """Return the walks of a scene's decals; None in other mappings, or without decals."""
        if mapping is not ImageMapping.WALKED or not len(scene.decals):
            return None
        walks = self.walk_cache.get(scene)
        if self._walks is None or self._walks[0] is not walks:
            self._release_walks()
            self._walks = walks, DataTexture(self.context, walks.texels)
        return self._walks[1]

    def _release_walks(self) -> None:
        if self._walks is not None:
            self._walks[1].release()
        self._walks = None

    def _materials_of(self, scene: SceneLike, images: ImageArray | None) -> MaterialArray | None:
        """Return the maps of a scene's images; None without any."""
        if images is None or not has_materials(scene):
            return None
        shape = images.height, images.width
        return self._materials.get(
            lambda: MaterialArray(self.context, scene.images, shape), images, *scene.images
        )

    def _relief_of(self, scene: SceneLike, images: ImageArray | None) -> Relief | None:
        """Return the relief of a scene's decals; None without any."""
        if images is None or not has_relief(scene):
            return None
        heights, widths = zip(*(image.pixels.shape[:2] for image in scene.images), strict=True)
        shape = min(max(heights), images.height), min(max(widths), images.width)  # no texel is averaged
        array = self._reliefs.get(
            lambda: ReliefArray(self.context, scene.images, shape), images, *scene.images
        )
        decals = self.decals(scene)
        assert decals is not None
        kept, stepped = self._relief, decals.layered or decals.nested or decals.limited
        if kept is None or kept[:2] != (array, decals) or kept[2] != decals.version:
            self._relief = kept = array, decals, decals.version, Relief(array, scene, stepped=stepped)
        return kept[3]

    def _masks_of(self, scene: SceneLike, objects: Sequence[object]) -> DataTexture | None:
        """Return the masks of objects of a scene; None if its decals are not limited."""
        if not is_limited(scene):
            return None
        table = scene.decals.receiver_table
        masks = tuple(object_mask(item, table) for item in objects)
        if self._masks is None or self._masks[0] != masks:
            self._release_masks()
            self._masks = masks, DataTexture(self.context, np.array(masks, np.int32))
        return self._masks[1]

    def _release_masks(self) -> None:
        if self._masks is not None:
            self._masks[1].release()
        self._masks = None

    def drawable(self, item: object) -> Drawable:
        """Return the drawable of an object."""
        return self._drawables.get(lambda: drawable_for(self.context, item), item)

    def decals(self, scene: SceneLike) -> DecalData | None:
        """Return the data of a scene's decals; None without decals."""
        decals = scene.decals
        if not len(decals):
            return None
        limited = is_limited(scene)
        lookups = RELIEF_LOOKUPS if has_relief(scene) else 1
        data = self._decals.get(
            lambda: DecalData(self.context, decals, limited=limited, lookups=lookups),
            decals,
            limited,
            lookups,
        )
        if isinstance(decals, DecalEditor):
            data.update(decals)
        return data

    def nested(self, scene: SceneLike) -> bool:
        """Return True if decals of a scene are nested, as far as known without their index."""
        if isinstance(scene.decals, DecalEditor):
            return scene.decals.nested
        lookups = RELIEF_LOOKUPS if has_relief(scene) else 1
        data = self._decals.find(scene.decals, is_limited(scene), lookups)
        return data is not None and data.nested

    def images(self, scene: SceneLike) -> ImageArray | None:
        """Return the images of a scene's decals; None without decals."""
        if not len(scene.decals):
            return None
        pixels = [image.pixels for image in scene.images]
        return self._images.get(lambda: ImageArray(self.context, pixels), *pixels)

    def sweep(self) -> None:
        """Release everything that was not used since the last sweep."""
        for cache in self._caches:
            cache.sweep()

    def release(self) -> None:
        """Release everything."""
        for cache in self._caches:
            cache.release()
        self._release_masks()
        self._release_walks()
        self.walk_cache.release()
