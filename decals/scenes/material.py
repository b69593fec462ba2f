"""`DecalMaterial`: an image with maps of its surface, which light reflects as on metal, lacquer or stone."""

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from blobtree._typing import Float32Array, UInt8Array
from blobtree.files import is_file
from blobtree.immutable import read_only
from blobtree.validation import describe
from decals.errors import InvalidImage
from decals.images.load import AnyImage, image_pixels
from decals.images.texels import Pixels, as_bytes, decode_srgb, unit_levels, without_excess
from decals.options import Values
from decals.scenes.scene import DecalImage
from decals.shaders import constants
from decals.validation import allowed_number

MAP_NAMES = {
    "pixels": ("basecolor", "base_color", "albedo", "diffuse", "color", "col"),
    "normal": ("normal", "normalgl", "normal_gl", "nor", "nrm"),
    "roughness": ("roughness", "rough"),
    "metallic": ("metallic", "metalness", "metal"),
    "occlusion": ("ao", "occlusion", "ambientocclusion", "ambient_occlusion"),
    "emission": ("emissive", "emission"),
    "height": ("height", "displacement", "disp"),
}
"""Endings of the names of files, without suffix, by the map that they hold."""

SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".tga"})
"""Suffixes of the files that `DecalMaterial.load` looks at."""

FLAT = (128, 128, 255)
"""Texel of a normal map where the surface is flat."""

MIN_ROUGHNESS = constants("material.glsl")["MIN_ROUGHNESS"]
"""Least roughness that is drawn: highlights of smoother surface would be smaller than a pixel."""

RIM_TAPER = 0.04
"""Part of the radius over which heights fall to 0 at the image's rim; at least 3 texels."""

UNSET: Any = None
"""Map that `DecalMaterial` fills in."""


@dataclass(frozen=True, eq=False)
class DecalMaterial(DecalImage):
    """An image of decals with maps of glTF's metallic-roughness model, wherever a `DecalImage` is accepted.

    All maps have the size of the base colour. Each is an image of any kind, see `decals.images.image_pixels`;
    roughness, metalness and occlusion may be single numbers from 0 to 1.

    Parameters
    ----------
    source : str
        Name of the material.
    pixels : image
        Base colour and alpha, sRGB; stored as uint8 or uint16[h, w, 4].
    normal : image, optional
        Normals in tangent space, x to the right, y up (OpenGL's, as in glTF); stored as uint8[h, w, 3].
        By default flat.
    roughness : image or float, optional
        From 0 (a mirror) to 1 (matt), the default. Of images the first channel counts, linear; stored as
        uint8[h, w].
    metallic : image or float, optional
        From 0 (no metal), the default, to 1 (metal). Images as for the roughness.
    occlusion : image or float, optional
        Share of the light from all around that arrives, 1 by default. Images as for the roughness.
    emission : image, optional
        Light that the decal sheds itself, sRGB; stored as uint8[h, w, 3]. By default none.
    height : image or float[h, w], optional
        Heights, stored as float32[h, w]. By default None.
    relief : float
        Height above the surface where the map is 1, in visible radii of each decal; negative values press the
        map in. Pictures show it, on meshes by parallax; `decals.displace` moves the surface. By default 0.

    Raises
    ------
    InvalidImage
        A map is no image, has another size or too few channels, or holds values that are not finite; or the
        relief is higher than a radius.

    Examples
    --------
    >>> import numpy
    >>> import decals
    >>> rivet = decals.DecalImage.load("rivet").pixels
    >>> steel = decals.DecalMaterial("steel", rivet, roughness=0.3, metallic=1.0)
    >>> steel.roughness[0, 0], steel.normal[0, 0].tolist()
    (np.uint8(76), [128, 128, 255])
    """

    pixels: Pixels = field(repr=False)
    normal: UInt8Array = field(default=UNSET, repr=False)
    roughness: Annotated[UInt8Array, Values(0.0, 1.0, kind=float)] = field(default=UNSET, repr=False)
    metallic: Annotated[UInt8Array, Values(0.0, 1.0, kind=float)] = field(default=UNSET, repr=False)
    occlusion: Annotated[UInt8Array, Values(0.0, 1.0, kind=float)] = field(default=UNSET, repr=False)
    emission: UInt8Array = field(default=UNSET, repr=False)
    height: Float32Array | None = field(default=None, repr=False)
    relief: Annotated[float, Values(-0.5, 0.5, "radii")] = 0.0

    if TYPE_CHECKING:  # images of any kind are converted

        def __init__(
            self,
            source: str,
            pixels: AnyImage,
            normal: AnyImage | None = None,
            roughness: AnyImage | float = 1.0,
            metallic: AnyImage | float = 0.0,
            occlusion: AnyImage | float = 1.0,
            emission: AnyImage | None = None,
            height: AnyImage | None = None,
            relief: float = 0.0,
        ) -> None: ...

    def __post_init__(self) -> None:
        pixels = without_excess(image_pixels(self.pixels, name=f"material {self.source!r}, base colour"))
        object.__setattr__(self, "pixels", pixels)
        super().__post_init__()
        shape = pixels.shape[:2]
        checked: dict[str, Any] = {
            "normal": self._colors("normal", FLAT),
            "roughness": self._levels("roughness", 1.0),
            "metallic": self._levels("metallic", 0.0),
            "occlusion": self._levels("occlusion", 1.0),
            "emission": self._colors("emission", (0, 0, 0)),
            "height": _heights(self._name("height"), self.height),
        }
        for name, array in checked.items():
            if array is not None and array.shape[:2] != shape:
                raise InvalidImage(
                    f"{self._name(name)}: expected {shape[1]} x {shape[0]} pixels as the base colour, "
                    f"got {array.shape[1]} x {array.shape[0]}; scale one of them"
                )
            object.__setattr__(self, name, None if array is None else read_only(array))
        object.__setattr__(self, "relief", self._checked_relief())

    @classmethod
    def load(
        cls, source: Any, *, folder: Path | None = None, name: str = "", relief: float = 0.0
    ) -> "DecalMaterial":
        """Return the material of a folder of maps, which are found by the endings of their names.

        Of a file ``steel_Roughness.png`` the ending, in any case, is ``roughness``. MAP_NAMES lists all.

        Parameters
        ----------
        source : str or path
            Folder of pictures.
        folder : Path, optional
            Folder of relative paths. Default: the working directory.
        name : str
            Name of the material. Default: that of the folder.
        relief : float
            Height of the value 1 of the height map, in radii of each decal. 0 draws no relief.

        Raises
        ------
        InvalidImage
            There is no such folder, no base colour in it, or two files for one map; or a map is invalid.

        Examples
        --------
        >>> import pathlib, tempfile, decals
        >>> from PIL import Image
        >>> folder = pathlib.Path(tempfile.mkdtemp()) / "steel"
        >>> folder.mkdir()
        >>> Image.new("RGB", (4, 4), "silver").save(folder / "steel_basecolor.png")
        >>> Image.new("L", (4, 4), 60).save(folder / "steel_roughness.png")
        >>> decals.DecalMaterial.load(folder).roughness[0, 0]
        np.uint8(60)
        """
        if isinstance(source, DecalMaterial):
            return source
        if not isinstance(source, str | os.PathLike):
            raise InvalidImage(f"material: expected the path of a folder, got {describe(source)}")
        path = (folder or Path()) / os.fspath(source)
        try:
            files = sorted(
                file for file in path.iterdir() if file.suffix.lower() in SUFFIXES and is_file(file)
            )
        except (OSError, ValueError) as error:
            raise InvalidImage(f"material: expected a folder of maps, found none at {str(path)!r}") from error
        maps = _maps_of(files)
        if "pixels" not in maps:
            endings = ", ".join(f"_{ending}" for ending in MAP_NAMES["pixels"])
            raise InvalidImage(
                f"material {str(path)!r}: expected a file of the base colour, got {[f.name for f in files]}; "
                f"let the name of one end with {endings}"
            )
        images: dict[str, Any] = {**maps}
        return cls(name or path.name or str(path), relief=relief, **images)

    def surface_texels(self) -> tuple[Float32Array, Float32Array]:
        """Return what shaders read: x, y, roughness, metalness; and emission in linear light, occlusion.

        Both are float32[h, w, 4], without alpha.
        """
        first = np.empty((*self.pixels.shape[:2], 4), np.float32)
        second = np.empty_like(first)
        first[..., :2] = (self.normal[..., :2].astype(np.float32) - 128.0) / 127.0
        first[..., :2] /= np.maximum(np.hypot(first[..., 0], first[..., 1]), 1.0)[..., None]
        first[..., 2] = np.maximum(self.roughness / np.float32(255), MIN_ROUGHNESS)
        first[..., 3] = self.metallic / np.float32(255)
        second[..., :3] = decode_srgb(np.arange(256) / 255.0).astype(np.float32)[self.emission]
        second[..., 3] = self.occlusion / np.float32(255)
        return first, second

    def relief_texels(self) -> Float32Array | None:
        """Return heights in radii, times alpha, as float32[h, w]; None without relief.

        They fall to 0 at the rim of the image, so that the surface has no step at rims and contact lines.
        """
        if self.relief == 0.0 or self.height is None:
            return None
        rows, columns = self.height.shape
        x, y = ((2.0 * np.arange(count) + 1.0) / count - 1.0 for count in (columns, rows))
        inner = 1.0 - np.hypot(x, y[:, None])  # distance from the rim, in radii
        texel = 2.0 / min(rows, columns)
        part = np.clip((inner - texel) / max(RIM_TAPER, 3.0 * texel), 0.0, 1.0)
        taper = part * part * (3.0 - 2.0 * part)
        alpha = unit_levels(self.pixels[..., 3])
        raised: Float32Array = (self.relief * taper * alpha * self.height).astype(np.float32)
        return raised

    def _checked_relief(self) -> float:
        """Return the relief, after a check against the heights."""
        name = self._name("relief")
        relief = allowed_number(name, self.relief, "a number of radii", np.isfinite, InvalidImage)
        highest = 0.0 if self.height is None else abs(relief) * float(np.abs(self.height).max(initial=0.0))
        if relief != 0.0 and self.height is None:
            raise InvalidImage(f"{name}: expected 0 without heights, got {relief:g}; give a height map")
        if highest > 1.0:
            raise InvalidImage(
                f"{name}: expected heights up to 1 radius, got {highest:g}; lower the relief or the heights"
            )
        return relief

    def _name(self, name: str) -> str:
        return f"material {self.source!r}, {name}"

    def _colors(self, name: str, default: tuple[int, int, int]) -> UInt8Array:
        """Return a map of three channels."""
        given = getattr(self, name)
        if given is None:
            return np.broadcast_to(np.array(default, np.uint8), (*self.pixels.shape[:2], 3))
        array = given if isinstance(given, np.ndarray) else None
        if array is not None and (array.ndim != 3 or array.shape[2] < 3):
            raise InvalidImage(
                f"{self._name(name)}: expected an image with three channels, got {list(array.shape)}"
            )
        return as_bytes(image_pixels(given, name=self._name(name)))[..., :3]

    def _levels(self, name: str, default: float) -> UInt8Array:
        """Return a map of one channel; a number stands for all texels."""
        given = getattr(self, name)
        value = default if given is None else given
        if isinstance(value, int | float | np.number) and not isinstance(value, bool):
            if not 0.0 <= value <= 1.0:
                raise InvalidImage(
                    f"{self._name(name)}: expected a number from 0 to 1, got {describe(value)}"
                )
            return np.full(self.pixels.shape[:2], round(255 * float(value)), np.uint8)
        return as_bytes(image_pixels(value, name=self._name(name)))[..., 0]


def _heights(name: str, given: Any) -> Float32Array | None:
    """Return heights as float32[h, w]; floats of any size are kept."""
    if given is None:
        return None
    array = given if isinstance(given, np.ndarray) else None
    if array is None or array.dtype.kind != "f" or array.ndim != 2:
        return unit_levels(image_pixels(given, name=name)[..., 0])
    heights = array.astype(np.float32)
    if not np.isfinite(heights).all():
        row, column = np.argwhere(~np.isfinite(heights))[0].tolist()
        raise InvalidImage(f"{name}: expected finite heights, got {array[row, column]} in row {row}")
    return heights


def _maps_of(files: list[Path]) -> dict[str, Path]:
    """Return the file of each map, by its name in `DecalMaterial`."""
    found: dict[str, Path] = {}
    for file in files:
        stem = re.sub(r"[^a-z]+", "_", file.stem.lower())
        for name, endings in MAP_NAMES.items():
            if any(stem == ending or stem.endswith(f"_{ending}") for ending in endings):
                if name in found:
                    raise InvalidImage(
                        f"{str(file.parent)!r}: expected one file for the map {name!r}, got "
                        f"{found[name].name!r} and {file.name!r}; remove one"
                    )
                found[name] = file
    return found
