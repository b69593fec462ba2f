"""OBJ files with their materials: an object for each part, in text that keeps all digits."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from decals.baking.materials import ROUGHNESS, Maps
from decals.baking.parts import Baked, Part
from decals.baking.pictures import png_bytes
from decals.scenes.origin import WORLD

MATERIAL = "baked"


def obj_files(baked: Baked, stem: str) -> dict[str, bytes]:
    """Return an OBJ file, and its materials and textures if it has any, by their names."""
    files: dict[str, bytes] = {}
    lines = ["# Implicit Decals"]
    if baked.maps is not None:
        library = f"{stem}.mtl"
        lines.append(f"mtllib {library}")
        files = _material_files(baked.maps, library, stem)
    vertices = places = 0
    for part in baked.parts:
        lines += [f"o {' '.join(part.name.split()) or 'object'}"]
        lines += _part_lines(part, baked, vertices + 1, places + 1)
        vertices += len(part.vertices)
        places += 0 if part.uv is None else len(part.uv)
    return {"": ("\n".join(lines) + "\n").encode(), **files}


def _part_lines(part: Part, baked: Baked, first: int, first_place: int) -> Iterable[str]:
    """Yield the lines of a part, whose vertices, normals and places have numbers from the first ones on."""
    rows: list[NDArray[np.generic]] = [part.vertices]
    if baked.origin != WORLD:
        rows = [part.vertices.astype(np.float64) + baked.origin]
    if part.color_bytes is not None:
        rows.append((part.color_bytes / 255.0).round(5).astype(np.float32))
    yield from _rows("v", *rows)
    yield from _rows("vn", part.normals)
    corners = part.faces.astype(np.int64)
    if part.uv is None:
        numbers = np.repeat(corners + first, 2, axis=1)
        yield from _rows("f", numbers, form=" %d//%d %d//%d %d//%d")
        return
    yield from _rows("vt", part.uv)
    yield f"usemtl {MATERIAL}"
    numbers = np.stack([corners + first, corners + first_place, corners + first], axis=2).reshape(-1, 9)
    yield from _rows("f", numbers, form=" %d/%d/%d %d/%d/%d %d/%d/%d")


def _rows(keyword: str, *arrays: NDArray[np.generic], form: str | None = None) -> Iterable[str]:
    """Yield a line for each row of arrays; numbers have as many digits as their type holds."""
    if form is None:
        form = "".join(f" %.{17 if array.dtype == np.float64 else 9}g" * array.shape[1] for array in arrays)
    line = keyword + form
    for row in zip(*(column for array in arrays for column in array.T.tolist()), strict=True):
        yield line % row


def _material_files(maps: Maps, library: str, stem: str) -> dict[str, bytes]:
    """Return the material file and its textures."""
    surface = maps.surface
    levels = {
        "color": maps.color,
        "normal": maps.normal,
        "roughness": None if surface is None else surface[..., 1],
        "metalness": None if surface is None else surface[..., 2],
        "emission": maps.emission,
    }
    files = {f"{stem}_{name}.png": png_bytes(of) for name, of in levels.items() if of is not None}
    keywords = {
        "color": "map_Kd",
        "normal": "norm",
        "roughness": "map_Pr",
        "metalness": "map_Pm",
        "emission": "map_Ke",
    }
    lines = [f"newmtl {MATERIAL}", "Kd 1 1 1", "Ks 0 0 0", "illum 1"]
    if surface is None:
        lines += [f"Pr {ROUGHNESS}", "Pm 0"]
    else:
        lines += ["Pr 1", "Pm 1"]
    if maps.emission is not None:
        lines.append("Ke 1 1 1")
    lines += [f"{keywords[name]} {stem}_{name}.png" for name, of in levels.items() if of is not None]
    return {library: ("\n".join(lines) + "\n").encode(), **files}
