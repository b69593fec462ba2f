"""OBJ files with their materials: an object for each part, in text that keeps all digits."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from decals.baking.materials import ROUGHNESS, Maps
from decals.baking.parts import Baked, Part, udim
from decals.baking.pictures import png_bytes
from decals.scenes.origin import WORLD

MATERIAL = "baked"


def obj_files(baked: Baked, stem: str) -> dict[str, bytes]:
    """Return an OBJ file, and its materials and textures if it has any, by their names."""
    files: dict[str, bytes] = {}
    lines = ["# Implicit Decals"]
    if baked.tiles:
        library, materials = f"{stem}.mtl", list[str]()
        lines.append(f"mtllib {library}")
        for tile, maps in enumerate(baked.tiles):
            suffix = f".{udim(tile)}" if len(baked.tiles) > 1 else ""
            text, pictures = _material(maps, stem, suffix)
            materials += text
            files |= pictures
        files[library] = ("\n".join(materials) + "\n").encode()
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
    numbers = np.stack([corners + first, corners + first_place, corners + first], axis=2).reshape(-1, 9)
    tiles = np.zeros(len(corners), np.int32) if part.tile_of_face is None else part.tile_of_face
    for tile in np.unique(tiles).tolist():
        yield f"usemtl {MATERIAL}" + (f".{udim(tile)}" if len(baked.tiles) > 1 else "")
        yield from _rows("f", numbers[tiles == tile], form=" %d/%d/%d %d/%d/%d %d/%d/%d")


def _rows(keyword: str, *arrays: NDArray[np.generic], form: str | None = None) -> Iterable[str]:
    """Yield a line for each row of arrays; numbers have as many digits as their type holds."""
    if form is None:
        form = "".join(f" %.{17 if array.dtype == np.float64 else 9}g" * array.shape[1] for array in arrays)
    line = keyword + form
    for row in zip(*(column for array in arrays for column in array.T.tolist()), strict=True):
        yield line % row


def _material(maps: Maps, stem: str, suffix: str) -> tuple[list[str], dict[str, bytes]]:
    """Return the lines of a material, whose name has a suffix, and its textures by their names."""
    surface = maps.surface
    levels = {
        "color": maps.color,
        "normal": maps.normal,
        "roughness": None if surface is None else surface[..., 1],
        "metalness": None if surface is None else surface[..., 2],
        "emission": maps.emission,
    }
    files = {f"{stem}_{name}{suffix}.png": png_bytes(of) for name, of in levels.items() if of is not None}
    keywords = {
        "color": "map_Kd",
        "normal": "norm",
        "roughness": "map_Pr",
        "metalness": "map_Pm",
        "emission": "map_Ke",
    }
    lines = [f"newmtl {MATERIAL}{suffix}", "Kd 1 1 1", "Ks 0 0 0", "illum 1"]
    if surface is None:
        lines += [f"Pr {ROUGHNESS}", "Pm 0"]
    else:
        lines += ["Pr 1", "Pm 1"]
    if maps.emission is not None:
        lines.append("Ke 1 1 1")
    lines += [f"{keywords[name]} {stem}_{name}{suffix}.png" for name, of in levels.items() if of is not None]
    return lines, files
