"""Pictures, the buffers behind them, and arrays that are filled tile by tile."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray
from PIL import Image, UnidentifiedImageError
from PIL.PngImagePlugin import PngInfo

from blobtree._typing import Float32Array, Int32Array, UInt8Array
from blobtree.errors import UnusableFile
from blobtree.files import read_file, write_atomically
from decals.errors import InvalidScene, TooMuchData
from decals.rendering.options import STUDIO, Size
from decals.rendering.targets import Targets
from decals.rendering.viewpoint import Tile
from decals.validation import as_path

RECIPE_KEY = "implicit-decals"
"""Keyword of the text in a PNG file that says how the picture was made."""


@dataclass(frozen=True, eq=False, repr=False)
class Picture:
    """A picture: an array of pixels that can be saved, and that a notebook shows.

    NumPy functions take it in place of its pixels.

    Parameters
    ----------
    pixels : uint8[h, w, 4]
        sRGB and straight alpha, row 0 at the top.
    recipe : mapping of str, optional
        How it was made, as plain values; PNG files keep it.

    Examples
    --------
    >>> import blobtree, decals, numpy
    >>> picture = decals.render(blobtree.Point((0, 0, 0), radius=1), size=(32, 24), samples=1)
    >>> picture.shape
    (24, 32, 4)
    >>> numpy.asarray(picture).dtype
    dtype('uint8')
    """

    pixels: UInt8Array
    recipe: Mapping[str, Any] | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Height, width and 4."""
        return self.pixels.shape

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.pixels, dtype) if copy else np.asarray(self.pixels, dtype)

    def __len__(self) -> int:
        return len(self.pixels)

    def __getitem__(self, key: Any) -> Any:
        """Return rows, pixels or channels, as of an array."""
        return self.pixels[key]

    def __repr__(self) -> str:
        return f"Picture({self.shape[1]} × {self.shape[0]} pixels)"

    def save(self, path: str | PathLike[str]) -> None:
        """Write the picture to a file, whole or not at all.

        Parameters
        ----------
        path : str or path
            File whose suffix decides the format: png, jpg, webp, tiff or any other that Pillow writes. In
            formats without alpha the picture lies on white.

        Raises
        ------
        InvalidScene
            If the path is no path, its suffix is unknown, or the file cannot be written.

        Examples
        --------
        >>> import tempfile, pathlib, blobtree, decals
        >>> picture = decals.render(blobtree.Point((0, 0, 0), radius=1), size=(32, 24), samples=1)
        >>> picture.save(pathlib.Path(tempfile.mkdtemp()) / "ball.jpg")
        """
        path = as_path(path)
        file_format = Image.registered_extensions().get(path.suffix.lower())
        if file_format not in Image.SAVE:
            raise InvalidScene(
                f"path: expected a picture file such as {path.stem + '.png'!r}, got {str(path)!r}"
            )
        image = Image.fromarray(self.pixels)
        content = BytesIO()
        try:
            if file_format in ("JPEG", "BMP", "PPM"):
                image = on_white(image)
            image.save(content, file_format, **self._notes(file_format))
            write_atomically(path, content.getvalue())
        except OSError as error:
            raise InvalidScene(
                f"could not write the picture {str(path)!r} ({error.strerror or error})"
            ) from error

    def _notes(self, file_format: str) -> dict[str, Any]:
        """Return options of Pillow that keep the recipe in a file of a format that can."""
        if self.recipe is None or file_format != "PNG":
            return {}
        notes = PngInfo()
        notes.add_itxt(RECIPE_KEY, json.dumps(self.recipe, ensure_ascii=False))
        return {"pnginfo": notes}

    def _repr_png_(self) -> bytes:
        """Return the picture as a PNG file, for notebooks."""
        file = BytesIO()
        Image.fromarray(self.pixels).save(file, "png")
        return file.getvalue()


def picture_recipe(path: Path) -> dict[str, Any] | None:
    """Return the recipe that a PNG file keeps; None without one.

    Raises
    ------
    UnusableFile
        The file cannot be read.
    InvalidScene
        It is no PNG file.
    """
    try:
        with Image.open(BytesIO(read_file(path)), formats=["PNG"]) as image:
            image.load()  # texts may stand behind the pixels
            recipe = json.loads(image.info.get(RECIPE_KEY, "null"))
    except UnidentifiedImageError:
        raise InvalidScene(f"expected a PNG file, got {str(path)!r}; give one that `render` wrote") from None
    except OSError as error:
        raise UnusableFile.of(error, path, "read") from error
    except ValueError:
        recipe = None
    return recipe if isinstance(recipe, dict) else None


def on_white(image: Image.Image) -> Image.Image:
    """Return a picture with alpha on white, as RGB."""
    white = Image.new("RGBA", image.size, (255, 255, 255, 255))
    return Image.alpha_composite(white, image.convert("RGBA")).convert("RGB")


@dataclass(frozen=True, eq=False)
class Buffers:
    """The surface and the decal behind every pixel of a picture; row 0 is at the top.

    Attributes
    ----------
    position, normal
        float32[h, w, 3], zero in the background; normals are unit and smooth.
    object_id
        int32[h, w], the object's index in the scene, -1 in the background.
    owner
        int32[h, w], the decal's index, -1 where no decal shows.
    field
        float32[h, w], the owner's field F after contact, ½ on its rim; zero without an owner.
    uv
        float32[h, w, 2], the owner's image coordinates, v upward; zero without an owner.
    color
        uint8[h, w, 4], the picture with one sample a pixel.

    Examples
    --------
    >>> import blobtree, decals
    >>> from decals.rendering import Renderer, RenderOptions
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
    >>> with Renderer() as renderer:
    ...     buffers = renderer.buffers(scene, RenderOptions(size=(32, 24)))
    >>> buffers.position.shape
    (24, 32, 3)
    >>> int(buffers.object_id[12, 16]), int(buffers.object_id[0, 0])
    (0, -1)
    """

    position: Float32Array
    normal: Float32Array
    object_id: Int32Array
    owner: Int32Array
    uv: Float32Array
    field: Float32Array
    color: UInt8Array


class TiledArray:
    """An array ``[h, w, channels]`` that is filled tile by tile; tiles count its rows from below."""

    def __init__(self, size: Size, channels: int, dtype: type[np.generic]) -> None:
        try:
            self.array: NDArray[Any] = np.zeros((size[1], size[0], channels), dtype)
        except MemoryError:
            raise TooMuchData(
                f"size: expected a picture that fits in memory, got {size[0]} x {size[1]} pixels; "
                "make it smaller"
            ) from None

    def insert(self, block: NDArray[Any], tile: Tile, samples: int = 1) -> None:
        """Copy a tile's pixels, its lowest row first, into the array."""
        left, bottom = tile.inner.x // samples, tile.inner.y // samples
        height, width = block.shape[:2]
        self.array[::-1][bottom : bottom + height, left : left + width] = block


class TiledBuffers:
    """Buffers that are filled tile by tile."""

    def __init__(self, size: Size) -> None:
        self._color = TiledArray(size, 4, np.uint8)
        self._position, self._normal, self._decal = (TiledArray(size, 4, np.float32) for _ in range(3))

    def insert(self, targets: Targets, tile: Tile) -> None:
        """Read a tile from its targets."""
        self._color.insert(targets.resolve.pixels(targets.light_pass.light, tile, 1, STUDIO), tile)
        self._position.insert(targets.gbuffer.read_position(tile), tile)
        self._normal.insert(targets.gbuffer.read_normal(tile), tile)
        self._decal.insert(targets.decal_pass.read_decal(tile), tile)

    @property
    def buffers(self) -> Buffers:
        """The buffers of all tiles."""
        position, decal = self._position.array, self._decal.array
        return Buffers(
            position=position[..., :3],
            normal=self._normal.array[..., :3],
            object_id=position[..., 3].astype(np.int32) - 1,
            owner=decal[..., 0].astype(np.int32),
            field=decal[..., 1],
            uv=decal[..., 2:],
            color=self._color.array,
        )
