"""Scenes as JSON: readable, versioned, saved atomically, and the same bits when loaded again.

::

    {
      "format": "implicit-decals-scene",
      "version": 1,
      "objects": [{"type": "mesh", ...}, {"type": "tree", ...}],
      "images": ["scale", "pictures/moss.png"],
      "camera": {"position": [x, y, z], ...},
      "decals": [
        {"position": [x, y, z], "normal": ..., "tangent": ..., "radius": r, "image": 0, "spill": false,
         "interaction": "overlap", "layer": 1, "tint": [r, g, b], "opacity": 1.0},
        ...
      ]
    }

The last four of a decal are written where they are not contact, 0, white and 1. Image -1 is the plain tint.

Numbers are the shortest decimals that give the same float32 again. Paths are relative to the scene file.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import UNSET, Meta, Raw, Struct, UnsetType
from numpy.typing import NDArray

from blobtree.nodes.io import Document, from_document, to_document, write_atomically
from decals.errors import DecalsError, InvalidScene
from decals.images import is_builtin
from decals.model import PLAIN, Decals, Interaction
from decals.scenes.camera import Camera
from decals.scenes.mesh_file import MeshArrays, read_mesh
from decals.scenes.scene import DecalImage, MeshObject, Scene, SceneObject, TreeObject

FORMAT = "implicit-decals-scene"
VERSION = 1
SAMPLE = "sample:"
"""How the source of a mesh begins that is a sample and no file."""

Triple = tuple[float, float, float]
Whole = Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)]
SampleLoader = Callable[[str], MeshArrays]
"""Gives the vertices and faces of a sample mesh by its name."""


_INTERACTIONS = {kind.name.lower(): kind for kind in Interaction}


class _Header(Struct):
    format: str = ""
    version: int = 0


class _InlineMesh(Struct, forbid_unknown_fields=True):
    """Little-endian float32 and int32 rows; msgspec writes bytes as base64."""

    vertices: bytes
    faces: bytes


class _MeshRecord(Struct, tag="mesh", tag_field="type", forbid_unknown_fields=True, omit_defaults=True):
    name: str
    color: Triple
    source: str | None = None
    data: _InlineMesh | None = None


class _TreeRecord(Struct, tag="tree", tag_field="type", forbid_unknown_fields=True):
    name: str
    tree: Document


class _CameraRecord(Struct, forbid_unknown_fields=True):
    position: Triple
    target: Triple
    up: Triple
    fov: float


class _DecalRecord(Struct, forbid_unknown_fields=True):
    position: Triple
    normal: Triple
    tangent: Triple
    radius: float
    image: Annotated[int, Meta(ge=PLAIN, le=2**31 - 1)] = 0
    spill: bool = False
    interaction: Literal["independent", "contact", "overlap"] | UnsetType = UNSET
    layer: Whole | UnsetType = UNSET
    tint: Triple | UnsetType = UNSET
    opacity: float | UnsetType = UNSET


class _SceneRecord(Struct, forbid_unknown_fields=True):
    format: Literal["implicit-decals-scene"]
    version: Literal[1]
    objects: list[_MeshRecord | _TreeRecord]
    images: list[str]
    camera: _CameraRecord
    decals: list[_DecalRecord]


def save_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene to a JSON file, whole or not at all.

    Meshes with a ``source`` and images are written as references, other meshes in full.

    Raises
    ------
    InvalidScene
        If the folder does not exist or cannot be written.
    """
    path = Path(path)
    folder = path.parent
    if not folder.is_dir():
        raise InvalidScene(
            f"expected an existing folder for the scene, found none at {str(folder)!r}; make it first"
        )
    try:
        write_atomically(path, to_json(scene, folder=folder))
    except OSError as error:
        raise InvalidScene(f"could not write the scene {str(path)!r} ({error.strerror})") from error


def load_scene(path: str | os.PathLike[str], *, samples: SampleLoader | None = None) -> Scene:
    """Read a scene from a JSON file.

    Parameters
    ----------
    path : str or path
        A file that `save_scene` wrote, or somebody's own.
    samples : callable, optional
        Gives the meshes whose source is ``"sample:NAME"``.

    Raises
    ------
    InvalidScene
        If the file is missing or is no scene; the message names the offending field.
    InvalidMesh, InvalidImage, blobtree.BlobTreeError
        If something that the scene refers to is missing or broken.
    """
    path = Path(path)
    try:
        text = path.read_bytes()
    except OSError as error:
        raise InvalidScene(
            f"could not read the scene {str(path)!r} ({error.strerror}); check the path"
        ) from error
    try:
        return from_json(text, folder=path.parent, samples=samples)
    except InvalidScene as error:
        raise InvalidScene(f"{str(path)!r}: {error}") from error


def to_json(scene: Scene, *, folder: Path) -> bytes:
    """Write a scene as UTF-8 JSON whose paths are relative to ``folder``; one object or decal a line."""
    camera = scene.camera
    parts = {
        "format": FORMAT,
        "version": VERSION,
        "objects": _lines(_object_record(item, folder) for item in scene.objects),
        "images": [_relative(image.source, folder) for image in scene.images],
        "camera": _CameraRecord(camera.position, camera.target, camera.up, camera.fov),
        "decals": _lines(_decal_records(scene.decals)),
    }
    fields = [
        b"  %b: %b" % (msgspec.json.encode(key), msgspec.json.encode(value)) for key, value in parts.items()
    ]
    return b"{\n" + b",\n".join(fields) + b"\n}\n"


def from_json(text: bytes, *, folder: Path, samples: SampleLoader | None = None) -> Scene:
    """Read a scene from JSON; see `load_scene`."""
    record = _decode(text)
    objects = [_object(item, folder, samples) for item in record.objects]
    return Scene(
        objects=tuple(objects),
        camera=_camera(record.camera),
        decals=_decals(record.decals),
        images=tuple(DecalImage.load(_absolute(source, folder)) for source in record.images),
    )


def is_scene(text: bytes) -> bool:
    """Whether JSON says of itself that it is a scene."""
    try:
        return msgspec.json.decode(text, type=_Header).format == FORMAT
    except msgspec.MsgspecError:
        return False


def _decode(text: bytes) -> _SceneRecord:
    try:
        header = msgspec.json.decode(text, type=_Header)
        if header.format != FORMAT:
            raise InvalidScene(f'expected a scene with "format": "{FORMAT}", got {header.format!r}')
        if header.version != VERSION:
            raise InvalidScene(
                f"expected a scene of version {VERSION}, got version {header.version}; "
                "it was written by another release of implicit-decals"
            )
        return msgspec.json.decode(text, type=_SceneRecord)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise InvalidScene(f"expected a scene, but {_lower_first(str(error))}; correct the file") from error


def _lower_first(text: str) -> str:
    return text[:1].lower() + text[1:]


def _lines(records: Iterator[Any]) -> Raw:
    """Encode a list with one record a line, which people and `diff` can read."""
    lines = [b"\n    " + msgspec.json.encode(record) for record in records]
    return Raw(b"[" + b",".join(lines) + b"\n  ]") if lines else Raw(b"[]")


# -- objects ------------------------------------------------------------------------------------------


def _object_record(item: SceneObject, folder: Path) -> _MeshRecord | _TreeRecord:
    if isinstance(item, TreeObject):
        return _TreeRecord(item.name, to_document(item.tree))
    if item.source is not None:
        return _MeshRecord(item.name, item.color, source=_relative(item.source, folder))
    data = _InlineMesh(_packed(item.vertices, "<f4"), _packed(item.faces, "<i4"))
    return _MeshRecord(item.name, item.color, data=data)


def _object(record: _MeshRecord | _TreeRecord, folder: Path, samples: SampleLoader | None) -> SceneObject:
    if isinstance(record, _TreeRecord):
        return TreeObject(record.name, from_document(record.tree))
    if (record.source is None) == (record.data is None):
        raise InvalidScene(f"mesh {record.name!r}: expected either 'source' or 'data'; give one of them")
    if record.data is not None:
        vertices, faces = _unpacked(record.name, record.data)
        return MeshObject(record.name, vertices, faces, record.color)
    vertices, faces = _mesh(str(record.source), folder, samples)
    source = _absolute(str(record.source), folder)
    return MeshObject(record.name, vertices, faces, record.color, source)


def _mesh(source: str, folder: Path, samples: SampleLoader | None) -> MeshArrays:
    if not source.startswith(SAMPLE):
        return read_mesh(folder / source)
    if samples is None:
        raise InvalidScene(f"the mesh {source!r} is a sample; pass samples=, or use the command line")
    return samples(source.removeprefix(SAMPLE))


def _packed(array: NDArray[Any], kind: str) -> bytes:
    return np.ascontiguousarray(array, kind).tobytes()


def _unpacked(name: str, data: _InlineMesh) -> MeshArrays:
    try:
        vertices = np.frombuffer(data.vertices, "<f4").reshape(-1, 3)
        faces = np.frombuffer(data.faces, "<i4").reshape(-1, 3)
    except ValueError as error:
        raise InvalidScene(f"mesh {name!r}: expected rows of three 4-byte numbers ({error})") from error
    return vertices.astype(np.float32), faces.astype(np.int32)


def _relative(source: str, folder: Path) -> str:
    """Write a path as seen from the folder, so that scene and files can move together."""
    path = Path(source)
    if _is_name(source):
        return source
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # another drive
        return path.resolve().as_posix()


def _absolute(source: str, folder: Path) -> str:
    return source if _is_name(source) else str(folder / source)


def _is_name(source: str) -> bool:
    """Whether a source is a sample or a generated image rather than a path."""
    return source.startswith(SAMPLE) or is_builtin(source)


# -- camera and decals --------------------------------------------------------------------------------


def _camera(record: _CameraRecord) -> Camera:
    try:
        return Camera(record.position, record.target, record.up, record.fov)
    except DecalsError as error:
        raise InvalidScene(f"camera: {error}") from error


def _decal_records(decals: Decals) -> Iterator[_DecalRecord]:
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
    return (_DecalRecord(*values) for values in zip(*columns, strict=True))


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


def _decals(records: list[_DecalRecord]) -> Decals:
    if not records:
        return Decals.empty()
    with np.errstate(over="ignore"):  # what overflows float32 is refused as infinite
        return _checked_decals(records)


def _checked_decals(records: list[_DecalRecord]) -> Decals:
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
