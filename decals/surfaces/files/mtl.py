"""Reader of MTL files, the materials of OBJ files: diffuse colours and their textures."""

from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float64Array
from decals.images.texels import decode_srgb
from decals.surfaces.base_color import BaseTexture, Wrap
from decals.surfaces.files.content import finite_numbers, text_lines
from decals.surfaces.files.faults import Notes
from decals.surfaces.files.paint import TextureFiles

_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-bm": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-mm": 2,
    "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip
"""Options of a texture and how many words follow each at most; three may be fewer."""


@dataclass(frozen=True)
class Material:
    """The base colour of a material: a linear factor, and a texture."""

    factor: Float64Array
    texture: BaseTexture | None = None


def read_materials(content: bytes, textures: TextureFiles, notes: Notes, name: str) -> dict[bytes, Material]:
    """Return the materials of an MTL file by their names; what is wrong in it becomes a note."""
    factors: dict[bytes, Float64Array] = {}
    maps: dict[bytes, BaseTexture | None] = {}
    material = b""
    for number, line in enumerate(text_lines(content), 1):
        keyword, _, rest = line.strip().replace(b"\t", b" ").partition(b" ")
        rest = rest.strip()
        if keyword == b"newmtl":
            material = rest
            factors[material] = np.ones(3)
        elif keyword == b"Kd":
            try:
                factors[material] = _light(rest)
            except ValueError:
                notes.add("colours that are no three numbers are left out", f"line {number} of {name}")
        elif keyword.lower() == b"map_kd":
            file, wrap = _texture(rest.decode("utf-8", "replace"))
            maps[material] = textures.texture(file, wrap)
    found = {}
    for one, factor in factors.items():
        texture = maps.get(one)
        black = texture is not None and not factor.any()  # some exporters write so where a texture counts
        found[one] = Material(np.ones(3) if black else factor, texture)
    return found


def _light(text: bytes) -> Float64Array:
    """Return the linear light of an sRGB colour, of which one number stands for all three."""
    numbers = finite_numbers(text.split()[:3])
    if len(numbers) not in (1, 3):
        raise ValueError
    light: Float64Array = decode_srgb(np.clip(np.resize(numbers, 3), 0.0, 1.0)).astype(np.float64)
    return light


def _texture(text: str) -> tuple[str, Wrap]:
    """Return the file and the wrap mode of a texture, without its other options."""
    words, wrap = text.split(" "), Wrap.REPEAT
    while len(words) > 1 and words[0] in _OPTIONS:
        count = _OPTIONS[words[0]]
        if words[0] == "-clamp" and words[1] == "on":
            wrap = Wrap.CLAMP
        if count == 3:
            count = next((i for i, word in enumerate(words[1:4]) if not _is_number(word)), 3)
        words = words[1 + count :]
    return " ".join(words).strip().strip('"').replace("\\", "/"), wrap


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
