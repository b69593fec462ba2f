"""Objects as a scene file has them: meshes by reference or in full, trees as BlobTree documents."""

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import UNSET, Meta, Struct, UnsetType
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Int32Array
from blobtree.files import is_file
from blobtree.io import TreeFile, from_tree_file, to_tree_file
from decals.errors import ImplicitDecalsError, InvalidScene
from decals.images.builtin import is_builtin
from decals.images.load import embedded_image, is_embedded, load_image, opaque
from decals.model import NO_IMAGE, Decals, Interaction
from decals.scenes.camera import Vector
from decals.scenes.objects import MeshObject, Paths, SceneObject, TreeObject, shape_color, spare_coordinates
from decals.scenes.origin import WORLD
from decals.surfaces.base_color import COLOR_ARRAYS, BaseColor, BaseTexture, Color
from decals.surfaces.extras import READERS
from decals.surfaces.mesh_data import MeshData
from decals.surfaces.normals import CREASE_ANGLE
from decals.surfaces.triangulate import MeshArrays

SAMPLE = "sample:"
"""How the source of a mesh begins that is a sample and no file."""

TRUST_ADVICE = "if you trust the author of the scene, pass trust=True (--trust on the command line)"

SampleLoader = Callable[[str], MeshArrays]
"""Gives the vertices and faces of a sample mesh by its name."""


_OPTIONS = "hidden", "locked", "labels", "named_only"
"""Options of an object that its record has under the same names."""


class _InlineMesh(Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Little-endian float32 and int32 rows; msgspec writes bytes as base64."""

    vertices: bytes
    faces: bytes
    coordinates: bytes | None = None


class _TextureRecord(Struct, forbid_unknown_fields=True):
    """A texture of a base colour, embedded as PNG."""

    pixels: str
    wrap: tuple[str, str]


class ColorRecord(Struct, forbid_unknown_fields=True, omit_defaults=True):
    """A base colour: little-endian rows of float32 and int32, and textures."""

    colors: bytes | None = None
    coordinates: bytes | None = None
    texture_of_face: bytes | None = None
    corners: bytes | None = None
    textures: list[_TextureRecord] = []


_ROWS = {
    "colors": ("<f4", 3),
    "coordinates": ("<f4", 2),
    "texture_of_face": ("<i4", 0),
    "corners": ("<i4", 3),
}
"""Type and width of the arrays of a base colour; 0 for numbers without rows."""

MAX_TEXELS = 1 << 27
"""Most pixels of all textures of a mesh."""

OF_SOURCE: Literal["source"] = "source"
"""Colour or coordinates of a mesh that has those of its source."""


class MeshRecord(Struct, tag="mesh", tag_field="type", forbid_unknown_fields=True, omit_defaults=True):
    """A mesh: where its triangles come from, or the triangles."""

    name: str
    color: Vector | Literal["source"] | ColorRecord
    source: str | None = None
    data: _InlineMesh | None = None
    crease_angle: float = CREASE_ANGLE
    origin: Vector | None = None
    hidden: Paths = ()
    locked: Paths = ()
    labels: tuple[str, ...] = ()
    named_only: bool = False
    orientation: Literal["outward", "keep"] = "keep"
    coordinates: Literal["source"] | None = None


class TreeRecord(Struct, tag="tree", tag_field="type", forbid_unknown_fields=True, omit_defaults=True):
    """A tree."""

    name: str
    tree: TreeFile
    origin: Vector | None = None
    hidden: Paths = ()
    locked: Paths = ()
    labels: tuple[str, ...] = ()
    named_only: bool = False
    names: tuple[tuple[tuple[int, ...], str], ...] = ()


def record_of(item: SceneObject, folder: Path) -> MeshRecord | TreeRecord:
    """Describe an object; paths are relative to the folder."""
    origin = None if item.origin == WORLD else item.origin
    kept: dict[str, Any] = {name: getattr(item, name) for name in _OPTIONS} | {"origin": origin}
    if isinstance(item, TreeObject):
        return TreeRecord(item.name, to_tree_file(item.tree), **kept, names=tuple(item.names.items()))
    if item.crease_angle != CREASE_ANGLE:
        kept["crease_angle"] = item.crease_angle
    if item.source is not None:
        kept["orientation"] = item.orientation.value
        kept["coordinates"] = None if item.coordinates is None else OF_SOURCE
        color = _color_record(item.color, item.source)
        return MeshRecord(item.name, color, source=relative(item.source, folder), **kept)
    placed = None if item.coordinates is None else _packed(item.coordinates, "<f4")
    data = _InlineMesh(_packed(item.vertices, "<f4"), _packed(item.faces, "<i4"), placed)
    return MeshRecord(item.name, _color_record(item.color, None), data=data, **kept)


def object_of(record: MeshRecord | TreeRecord, folder: Path, samples: SampleLoader | None) -> SceneObject:
    """Make, read or fetch an object that was described.

    Raises
    ------
    InvalidScene, InvalidMesh, blobtree.ImplicitDecalsError
        If what it names is missing or broken.
    """
    kept: dict[str, Any] = {name: getattr(record, name) for name in _OPTIONS}
    if isinstance(record, TreeRecord):
        tree, names = from_tree_file(record.tree), dict(record.names)
        return TreeObject(record.name, tree, record.origin or WORLD, **kept, names=names)
    if (record.source is None) == (record.data is None):
        raise InvalidScene(f"mesh {record.name!r}: expected either 'source' or 'data'; give one of them")
    origin, angle = record.origin or WORLD, record.crease_angle
    kept["orientation"] = record.orientation
    if record.data is not None:
        vertices, faces, kept["coordinates"] = _unpacked(record.name, record.data)
        color = _color_of(record, None, None)
        return MeshObject(record.name, vertices, faces, color, None, angle, origin, **kept)
    mesh = _mesh(str(record.source), folder, samples)
    source = absolute(str(record.source), folder)
    local = mesh.vertices - np.array(origin)
    color = _color_of(record, mesh, source)
    kept["coordinates"] = None if record.coordinates is None else spare_coordinates(mesh, color)
    return MeshObject(record.name, local, mesh.faces, color, source, angle, origin, **kept)


def _color_record(color: Color | BaseColor, source: str | None) -> Vector | Literal["source"] | ColorRecord:
    """Describe the colour of a mesh; a word is enough for the colours of its source."""
    if not isinstance(color, BaseColor):
        return color
    if source is not None and color.source == source:
        return OF_SOURCE
    arrays = {name: getattr(color, name) for name in COLOR_ARRAYS}
    packed = {
        name: None if array is None else _packed(array, _ROWS[name][0]) for name, array in arrays.items()
    }
    textures = [
        _TextureRecord(embedded_image(opaque(texture.pixels)), (texture.wrap[0].value, texture.wrap[1].value))
        for texture in color.textures
    ]
    return ColorRecord(**packed, textures=textures)


def _color_of(record: MeshRecord, mesh: MeshData | None, source: str | None) -> Color | BaseColor:
    """Make the colour of a mesh that was described, or take that of its source."""
    color = record.color
    if isinstance(color, tuple):
        return color
    if not isinstance(color, ColorRecord):
        if mesh is None:
            raise InvalidScene(
                f"mesh {record.name!r}: expected a 'source' with its colours; give the colours"
            )
        return shape_color(mesh, None, source)
    try:
        arrays: dict[str, Any] = {
            name: None
            if (data := getattr(color, name)) is None
            else np.frombuffer(data, kind).reshape((-1, width) if width else (-1,))
            for name, (kind, width) in _ROWS.items()
        }
    except ValueError as error:
        raise InvalidScene(
            f"mesh {record.name!r}, colour: expected rows of 4-byte numbers ({error})"
        ) from error
    if not all(is_embedded(texture.pixels) for texture in color.textures):
        raise InvalidScene(f"mesh {record.name!r}, texture: expected embedded pictures, got other text")
    return BaseColor(**arrays, textures=_textures(record.name, color.textures))


def _textures(name: str, records: Iterable[_TextureRecord]) -> list[BaseTexture]:
    """Decode the textures of a mesh; InvalidScene if they are too large together."""
    textures: list[BaseTexture] = []
    texels = 0
    for record in records:
        textures.append(BaseTexture(load_image(record.pixels), record.wrap))
        texels += textures[-1].pixels[..., 0].size
        if texels > MAX_TEXELS:
            raise InvalidScene(
                f"mesh {name!r}: expected textures of {MAX_TEXELS:,} pixels at most; scale them"
            )
    return textures


def _mesh(source: str, folder: Path, samples: SampleLoader | None) -> MeshData:
    if not source.startswith(SAMPLE):
        data: MeshData = READERS["file"](folder / source)
        return data
    if samples is None:
        raise InvalidScene(f"the mesh {source!r} is a sample; pass samples=, or use the command line")
    return MeshData(*samples(source.removeprefix(SAMPLE)))


def _packed(array: NDArray[Any], kind: str) -> bytes:
    return np.ascontiguousarray(array, kind).tobytes()


def _unpacked(name: str, data: _InlineMesh) -> tuple[Float32Array, Int32Array, Float32Array | None]:
    """Return vertices, faces and, if there are any, coordinates of corners."""
    placed = None
    try:
        vertices = np.frombuffer(data.vertices, "<f4").reshape(-1, 3)
        faces = np.frombuffer(data.faces, "<i4").reshape(-1, 3)
        if data.coordinates is not None:
            placed = np.frombuffer(data.coordinates, "<f4").reshape(-1, 3, 2).astype(np.float32)
    except ValueError as error:
        raise InvalidScene(f"mesh {name!r}: expected rows of 4-byte numbers ({error})") from error
    return vertices.astype(np.float32), faces.astype(np.int32), placed


def check_inside(sources: Iterable[str], folder: Path) -> None:
    """Raise InvalidScene for a path that leads out of the folder of its scene, also by a symbolic link."""
    root = Path(os.path.realpath(folder))
    for source in sources:
        if _is_name(source):
            continue
        try:
            inside = Path(os.path.realpath(folder / source)).is_relative_to(root)
        except ValueError:
            inside = False
        if not inside:
            raise InvalidScene(
                f"expected files in the folder of the scene, {str(root)!r}, got {source!r}; {TRUST_ADVICE}"
            )


def relative(source: str, folder: Path) -> str:
    """Write a path as seen from the folder, so that scene and files can move together."""
    path = Path(source)
    if _is_name(source):
        return source
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # another drive
        return path.resolve().as_posix()


def picture_source(source: str, folder: Path) -> str:
    """Return the name or the path of a picture as a file has it; empty if it has neither."""
    return relative(source, folder) if is_builtin(source) or is_file(Path(source)) else ""


def absolute(source: str, folder: Path) -> str:
    """Undo `relative`."""
    return source if _is_name(source) else str(folder / source)


def _is_name(source: str) -> bool:
    """Return True if a source is a sample, a generated image or an embedded one rather than a path."""
    return source.startswith(SAMPLE) or is_builtin(source) or is_embedded(source)


Whole = Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)]

_INTERACTIONS = {kind.name.lower(): kind for kind in Interaction}
_OLD_NAMES = {"contact": Interaction.PUSH}
"""Names of interactions in files of earlier versions."""


class DecalRecord(Struct, forbid_unknown_fields=True):
    """One decal; `decals.scenes.files` shows it in a file."""

    position: Vector
    normal: Vector
    tangent: Vector
    radius: float
    image: Annotated[int, Meta(ge=NO_IMAGE, le=2**31 - 1)] = 0
    spill: bool = False
    interaction: Literal["independent", "push", "overlap", "contact"] | UnsetType = UNSET
    layer: Whole | UnsetType = UNSET
    tint: Vector | UnsetType = UNSET
    opacity: float | UnsetType = UNSET
    receivers: str | UnsetType = UNSET
    fade_angle: float | UnsetType = UNSET
    fade_depth: float | UnsetType = UNSET
    single_sheet: bool | UnsetType = UNSET


_ARRAYS: dict[str, tuple[str, Any]] = {
    "position": ("positions", UNSET),
    "normal": ("normals", UNSET),
    "tangent": ("tangents", UNSET),
    "radius": ("radii", UNSET),
    "image": ("images", UNSET),
    "spill": ("spill", UNSET),
    "interaction": ("interactions", "push"),
    "layer": ("layers", 0),
    "tint": ("tints", (1.0, 1.0, 1.0)),
    "opacity": ("opacities", 1.0),
    "receivers": ("receivers", ""),
    "fade_angle": ("fade_angles", 0.0),
    "fade_depth": ("fade_depths", 0.0),
    "single_sheet": ("single_sheets", False),
}
"""Array of `Decals` for each field of a record, and the value that a file leaves out."""


def records_of(decals: Decals) -> Iterator[DecalRecord]:
    """Describe decals, in their order."""
    columns = (_values(decals, array, default) for array, default in _ARRAYS.values())
    return (DecalRecord(*values) for values in zip(*columns, strict=True))


def _values(decals: Decals, array: str, default: Any) -> Iterator[Any]:
    """Yield the value of each decal as JSON has it; UNSET for the default."""
    values = getattr(decals, array)
    if array == "interactions":
        values = np.array(list(_INTERACTIONS))[values]
    elif values.dtype == np.float32:
        values = decimals(values)
    for value in values.tolist():
        known = tuple(value) if isinstance(value, list) else value
        yield UNSET if known == default else known


def decimals(array: NDArray[np.float32]) -> NDArray[np.float64]:
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
    arrays = {array: _column(records, name, default) for name, (array, default) in _ARRAYS.items()}
    try:
        return Decals(**arrays)
    except ImplicitDecalsError as error:
        raise InvalidScene(f"decals: {error}") from error


def _column(records: list[DecalRecord], name: str, default: Any) -> Any:
    """Return a field of all records, numbers in float32; what overflows it is refused as infinite."""
    given = (getattr(record, name) for record in records)
    values = [default if value is UNSET else value for value in given]
    if name == "interaction":
        known = _INTERACTIONS | _OLD_NAMES
        values = [known[value] for value in values]
    if name == "receivers":
        return values
    with np.errstate(over="ignore"):
        return np.array(values, np.float32 if isinstance(values[0], float | tuple) else None)
