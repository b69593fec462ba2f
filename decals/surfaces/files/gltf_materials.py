"""Base colours of a glTF file's materials: factors, and textures with their places.

A fault in them costs no face: it is a warning.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

import msgspec
import numpy as np
from msgspec import Raw, field

from blobtree._typing import Float64Array
from decals.errors import InvalidImage
from decals.images.load import picture_pixels
from decals.surfaces.base_color import BaseTexture, Wrap
from decals.surfaces.files.faults import Notes, Unreadable, item
from decals.surfaces.files.gltf_buffers import Buffers
from decals.surfaces.files.gltf_document import BufferView, Document, Index, Record
from decals.surfaces.files.paint import MAX_TEXELS
from decals.surfaces.files.uris import read_uri

WRAPS = {10497: Wrap.REPEAT, 33071: Wrap.CLAMP, 33648: Wrap.MIRROR}
"""Wrap modes by their codes of OpenGL."""

Pair = tuple[float, float]
_Kind = TypeVar("_Kind", bound=Record)
_Found = TypeVar("_Found")


class _Transform(Record, frozen=True):
    offset: Pair = (0.0, 0.0)
    rotation: float = 0.0
    scale: Pair = (1.0, 1.0)
    tex_coord: Index | None = None


UNMOVED = _Transform()


class _InfoExtensions(Record, frozen=True):
    transform: _Transform | None = field(name="KHR_texture_transform", default=None)


class _Info(Record, frozen=True):
    """Use of a texture by a material."""

    index: Index
    tex_coord: Index = 0
    extensions: _InfoExtensions = _InfoExtensions()


class _Metallic(Record, frozen=True):
    base_color_factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: _Info | None = None


class _Specular(Record, frozen=True):
    diffuse_factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    diffuse_texture: _Info | None = None


class _MaterialExtensions(Record, frozen=True):
    specular: _Specular | None = field(name="KHR_materials_pbrSpecularGlossiness", default=None)


class _Material(Record, frozen=True):
    pbr_metallic_roughness: _Metallic = _Metallic()
    extensions: _MaterialExtensions = _MaterialExtensions()


class _Source(Record, frozen=True):
    source: Index


class _TextureExtensions(Record, frozen=True):
    webp: _Source | None = field(name="EXT_texture_webp", default=None)
    avif: _Source | None = field(name="EXT_texture_avif", default=None)
    basisu: _Source | None = field(name="KHR_texture_basisu", default=None)


class _Texture(Record, frozen=True):
    source: Index | None = None
    sampler: Index | None = None
    extensions: _TextureExtensions = _TextureExtensions()


class _Sampler(Record, frozen=True):
    wrap_s: int = field(name="wrapS", default=10497)
    wrap_t: int = field(name="wrapT", default=10497)


class _Image(Record, frozen=True):
    uri: str | None = None
    buffer_view: Index | None = None


@dataclass(frozen=True, slots=True)
class Material:
    """The base colour of a material."""

    factor: Float64Array
    """Linear red, green and blue."""

    texture: BaseTexture | None = None
    texcoord: int = 0
    """Set of the texture's coordinates."""

    transform: _Transform = UNMOVED

    def placed(self, coordinates: Float64Array) -> Float64Array:
        """Return a file's coordinates as those of a `BaseTexture`, whose v points upward."""
        turn = self.transform.rotation
        rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        found = coordinates * self.transform.scale @ rotation.T + self.transform.offset
        return np.stack([found[:, 0], 1.0 - found[:, 1]], axis=1)


class Materials:
    """The materials of a file, each decoded when it is first used."""

    def __init__(self, document: Document, buffers: Buffers, folder: Path, notes: Notes) -> None:
        self._document = document
        self._buffers = buffers
        self._folder = folder
        self._notes = notes
        self._lists: dict[str, tuple[Raw, ...]] = {}
        self._materials: dict[int, Material | None] = {}
        self._textures: dict[int, BaseTexture | None] = {}
        self._texels = 0

    def of(self, index: int | None, place: str) -> Material | None:
        """Return a material that a place of the file names; None if it has none or a wrong one."""
        if index is None:
            return None
        if index not in self._materials:
            self._materials[index] = self._tried(partial(self._material, index, place), "materials")
        return self._materials[index]

    def _tried(self, read: Callable[[], _Found], kind: str) -> _Found | None:
        """Return what a function reads; for a fault, note that things of its kind are left out."""
        try:
            return read()
        except (Unreadable, InvalidImage) as fault:
            self._notes.add(f"{kind} are left out", str(fault))
            return None

    def _material(self, index: int, place: str) -> Material:
        record = self._record("materials", index, place, _Material)
        specular, metallic = record.extensions.specular, record.pbr_metallic_roughness
        factor, info = metallic.base_color_factor, metallic.base_color_texture
        if specular is not None:
            factor, info = specular.diffuse_factor, specular.diffuse_texture
        linear = np.clip(factor[:3], 0.0, 1.0)
        if info is None:
            return Material(linear)
        if info.index not in self._textures:
            read = partial(self._texture, info.index, f"material {index}")
            self._textures[info.index] = self._tried(read, "textures")
        transform = info.extensions.transform or UNMOVED
        texcoord = info.tex_coord if transform.tex_coord is None else transform.tex_coord
        return Material(linear, self._textures[info.index], texcoord, transform)

    def _texture(self, index: int, place: str) -> BaseTexture:
        record = self._record("textures", index, place, _Texture)
        others = [other.source for other in (record.extensions.webp, record.extensions.avif) if other]
        source = others[0] if others else record.source
        if source is None:
            kind = (
                "only a KTX2 image, which is not read"
                if record.extensions.basisu
                else "no image that is read"
            )
            raise Unreadable(f"texture {index} has {kind}")
        sampler = _Sampler()
        if record.sampler is not None:
            sampler = self._record("samplers", record.sampler, f"texture {index}", _Sampler)
        wrap = WRAPS.get(sampler.wrap_s, Wrap.REPEAT), WRAPS.get(sampler.wrap_t, Wrap.REPEAT)
        pixels = picture_pixels(self._image(source, f"texture {index}"), f"image {source}")
        self._texels += pixels.shape[0] * pixels.shape[1]
        if self._texels > MAX_TEXELS:
            raise Unreadable(f"its textures have more than {MAX_TEXELS:,} pixels with texture {index}")
        return BaseTexture(pixels, wrap)

    def _image(self, index: int, place: str) -> bytes:
        """Return the bytes of an image's file."""
        image, name = self._record("images", index, place, _Image), f"image {index}"
        if image.uri is not None:
            return read_uri(image.uri, self._folder, name)
        if image.buffer_view is None:
            raise Unreadable(f"{name} has neither a URI nor a buffer view")
        view: BufferView = item(self._document.buffer_views, image.buffer_view, "buffer view", name)
        content = self._buffers.content(view.buffer, f"buffer view {image.buffer_view}")
        return content[view.byte_offset : view.byte_offset + view.byte_length]

    def _record(self, kind: str, index: int, place: str, record: type[_Kind]) -> _Kind:
        """Return a record of one of the lists that are not decoded with the document."""
        try:
            if kind not in self._lists:
                raw: Raw = getattr(self._document, kind)
                self._lists[kind] = msgspec.json.decode(raw or b"[]", type=tuple[Raw, ...])
            return msgspec.json.decode(item(self._lists[kind], index, kind[:-1], place), type=record)
        except RecursionError:
            raise Unreadable(f"{kind[:-1]} {index} is nested too deeply") from None
        except msgspec.DecodeError as error:
            raise Unreadable(f"{kind[:-1]} {index} is wrong: {error}") from error
