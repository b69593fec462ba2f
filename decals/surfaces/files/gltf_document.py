"""The parts of a glTF 2.0 file: its JSON as typed records, and the binary chunk of a GLB file.

The records hold what the mesh follows from. Materials stay undecoded, since a fault in them costs no face.
"""

import json
import struct
from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta, Raw, Struct, field

from decals.surfaces.files.faults import Notes, Unreadable

MAGIC = b"glTF"
"""How a GLB file begins."""

JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
"""Types of the chunks of a GLB file."""

DRACO = "KHR_draco_mesh_compression"
MESHOPT = "EXT_meshopt_compression", "KHR_meshopt_compression"
"""Extensions that compress geometry, which is not read."""

_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "EXT_lights_",
             "KHR_xmp", "KHR_animation_", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing",
             "KHR_node_visibility", DRACO, *MESHOPT)  # fmt: skip
"""How the extensions begin that have no effect on faces, or that the reader treats where they are used."""

Index = Annotated[int, Meta(ge=0)]
Triple = tuple[float, float, float]

_Kind = TypeVar("_Kind", bound=Struct)


class Record(Struct, rename="camel", frozen=True):
    """A record of the file; names that it does not declare are skipped."""


class _Asset(Record, frozen=True):
    version: str | float = ""
    min_version: str | float = ""


class _Head(Record, frozen=True):
    asset: _Asset = _Asset()


class Scene(Record, frozen=True):
    """The roots of a scene."""

    nodes: tuple[Index, ...] = ()


class Instancing(Record, frozen=True):
    """Accessors of the places of copies (EXT_mesh_gpu_instancing)."""

    attributes: dict[str, Index] = {}


class _Visibility(Record, frozen=True):
    visible: bool = True


class NodeExtensions(Record, frozen=True):
    """Extensions of a node that have an effect on the mesh."""

    instancing: Instancing | None = field(name="EXT_mesh_gpu_instancing", default=None)
    visibility: _Visibility = field(name="KHR_node_visibility", default=_Visibility())


class Node(Record, frozen=True):
    """A node: its place in its parent, and what it shows there."""

    children: tuple[Index, ...] = ()
    mesh: Index | None = None
    skin: Index | None = None
    weights: tuple[float, ...] | None = None
    matrix: Annotated[tuple[float, ...], Meta(min_length=16, max_length=16)] | None = None
    translation: Triple = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    scale: Triple = (1.0, 1.0, 1.0)
    extensions: NodeExtensions = NodeExtensions()


class _PrimitiveExtensions(Record, frozen=True):
    draco: Raw = field(name=DRACO, default=Raw())


class Primitive(Record, frozen=True):
    """Accessors of the vertices and corners of a part of a mesh."""

    attributes: dict[str, Index] = {}
    indices: Index | None = None
    material: int | None = None
    mode: int = 4
    targets: tuple[dict[str, Index], ...] = ()
    extensions: _PrimitiveExtensions = _PrimitiveExtensions()


class Mesh(Record, frozen=True):
    """Primitives, and the weights of their morph targets."""

    primitives: tuple[Primitive, ...] = ()
    weights: tuple[float, ...] = ()


class Skin(Record, frozen=True):
    """Nodes that move the vertices of a mesh."""

    joints: tuple[Index, ...] = ()
    inverse_bind_matrices: Index | None = None


class _SparseIndices(Record, frozen=True):
    buffer_view: Index
    component_type: int
    byte_offset: Index = 0


class _SparseValues(Record, frozen=True):
    buffer_view: Index
    byte_offset: Index = 0


class Sparse(Record, frozen=True):
    """Elements of an accessor that replace others."""

    count: Index
    indices: _SparseIndices
    values: _SparseValues


class Accessor(Record, frozen=True):
    """Elements of equal type within a buffer view."""

    component_type: int
    count: Index
    type: str
    buffer_view: Index | None = None
    byte_offset: Index = 0
    normalized: bool = False
    sparse: Sparse | None = None


class _ViewExtensions(Record, frozen=True):
    meshopt: Raw = field(name=MESHOPT[0], default=Raw())
    meshopt_khr: Raw = field(name=MESHOPT[1], default=Raw())


class BufferView(Record, frozen=True):
    """A part of a buffer."""

    buffer: Index
    byte_length: Index
    byte_offset: Index = 0
    byte_stride: Index | None = None
    extensions: _ViewExtensions = _ViewExtensions()


class Buffer(Record, frozen=True):
    """Bytes beside the JSON."""

    uri: str | None = None


class Document(Record, frozen=True):
    """All records of a file; what has an effect on colours alone stays undecoded."""

    scene: Index | None = None
    scenes: tuple[Scene, ...] = ()
    nodes: tuple[Node, ...] = ()
    meshes: tuple[Mesh, ...] = ()
    skins: tuple[Skin, ...] = ()
    accessors: tuple[Accessor, ...] = ()
    buffer_views: tuple[BufferView, ...] = ()
    buffers: tuple[Buffer, ...] = ()
    materials: Raw = Raw()
    textures: Raw = Raw()
    images: Raw = Raw()
    samplers: Raw = Raw()
    extensions_required: tuple[str, ...] = ()


def parse(content: bytes, notes: Notes) -> tuple[Document, bytes | None]:
    """Return the records of a glTF or GLB file, and the binary chunk if it has one."""
    text, binary = _chunks(content, notes) if content.startswith(MAGIC) else (content, None)
    document = _decoded(text)
    for name in document.extensions_required:
        if not name.startswith(_HARMLESS):
            notes.add("the mesh may differ, for it requires extensions that are not read", name[:60])
    return document, binary


def _chunks(content: bytes, notes: Notes) -> tuple[bytes, bytes | None]:
    """Return the JSON and the binary chunk of a GLB file."""
    if len(content) < 20:
        raise Unreadable(f"its {len(content)} bytes are no whole header")
    version, length, size, kind = struct.unpack_from("<4I", content, 4)
    if version != 2:
        raise _of_version(str(version))
    if kind != JSON_CHUNK:
        raise Unreadable("its first chunk holds no JSON")
    if length > len(content):
        notes.add("the file ends early, but behind its mesh", f"{len(content)} of {length} bytes")
    text, place = _chunk(content, 20, size, "JSON")
    while place + 8 <= len(content):
        size, kind = struct.unpack_from("<2I", content, place)
        if kind == BINARY_CHUNK:
            return text, _chunk(content, place + 8, size, "binary")[0]
        place += 8 + size
    return text, None


def _chunk(content: bytes, start: int, size: int, name: str) -> tuple[bytes, int]:
    """Return the bytes of a chunk, and where the next one begins."""
    if start + size > len(content):
        raise Unreadable(f"its {name} chunk has {size} bytes, but only {len(content) - start} follow")
    return content[start : start + size], start + size


def _decoded(content: bytes) -> Document:
    """Return the records of the JSON; unpaired bytes become replacement characters."""
    text = content.decode(json.detect_encoding(content), "replace").strip("\ufeff\0")
    asset = _decode(text, _Head).asset
    if not str(asset.version).startswith("2") or str(asset.min_version) not in ("", "2.0"):
        raise _of_version(str(asset.min_version or asset.version))
    return _decode(text, Document)


def _decode(text: str, kind: type[_Kind]) -> _Kind:
    try:
        return msgspec.json.decode(text, type=kind)
    except RecursionError:
        raise Unreadable("its JSON is nested too deeply") from None
    except (msgspec.DecodeError, UnicodeError) as error:
        raise Unreadable(f"its JSON is wrong: {error}") from error


def _of_version(version: str) -> Unreadable:
    named = f"it is of version {version[:20]} of glTF" if version else "it names no version of glTF"
    return Unreadable(f"{named}, and version 2.0 is read", "convert it to glTF 2.0")
