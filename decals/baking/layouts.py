"""Layouts: how surfaces lie on textures, and which of them has the shortest seams."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from blobtree._typing import Float32Array, Int32Array, Int64Array
from blobtree.progress import Progress
from decals.baking.atlas import UNWRAPPING, unwrap
from decals.baking.box_atlas import MAX_CHARTS, box_atlas
from decals.baking.meshes import BakeMesh
from decals.baking.seams import Seams
from decals.baking.texture import Sheet, gutter_width
from decals.baking.unwrapped import Unwrapped
from decals.errors import InvalidMesh, InvalidScene

AUTO, BOX, XATLAS, OWN = "auto", "box", "xatlas", "own"
LAYOUTS = (AUTO, BOX, XATLAS, OWN)
"""Layouts of textures."""

MAX_TILES = 100
"""Most textures of a bake: the names of UDIM tiles go from 1001 to 1100 by rows of ten."""

TRIES = 4
"""Times that parts of charts which lie over others become charts of their own."""

LOOK_SIZE = 1024
"""Texels of a row at which overlaps are looked for."""

INSET = -0.05
"""Faces are narrower by so many samples where overlaps are looked for, so that neighbours have none."""

MAX_OVERLAP = 1e-4
"""Part of the faces that lie over others in an own layout, or one of xatlas, up to which it is used."""

MAX_UNEVENNESS = 2.0
"""Texels along a length, over those in the coarsest tenth of a surface, up to which AUTO takes own ones."""

OUTSIDE = 1e-4
"""Distance from the unit square up to which texture coordinates are rounded ones."""


def lay_out(
    meshes: Sequence[BakeMesh], size: int, layout: str, tiles: int, report: Progress
) -> list[Unwrapped]:
    """Return places for all meshes on textures, by a layout.

    AUTO takes the own coordinates of the meshes or the box atlas, the one with the shorter seams. Own
    coordinates count if all meshes have some, nothing overlaps, and texels are spread evenly. The box atlas
    counts up to `MAX_CHARTS` charts without overlaps. Where neither does, AUTO takes xatlas.

    Raises
    ------
    InvalidMesh
        The meshes cannot have this layout.
    InvalidScene
        xatlas makes one texture only.
    MissingPackage
        xatlas is needed and not installed.
    """
    report(UNWRAPPING, 0.0)
    if layout == OWN:
        return own_layout(meshes, size, tiles)
    if layout in (AUTO, BOX):
        boxes = _boxes(meshes, size, tiles, report)
        if layout == AUTO:
            choices = [made for made in (_even_own(meshes, size, tiles), boxes) if made is not None]
            if len(choices) == 1:
                return choices[0]
            if choices:
                return min(choices, key=lambda made: Seams.of(meshes, made).length)
        elif boxes is None:
            raise InvalidMesh(
                f"layout 'box': expected a surface that needs at most {MAX_CHARTS} charts without overlaps; "
                "use layout='xatlas'"
            )
        else:
            return boxes
    if tiles > 1:
        raise InvalidScene(f"tiles: expected 1 with layout 'xatlas', got {tiles}; use layout='box' or 'own'")
    made = _without_overlaps(
        meshes,
        size,
        MAX_OVERLAP,
        report,
        lambda groups, tick: unwrap(meshes, size, lambda _, share: tick(share), groups),
    )
    if made is None:
        raise InvalidMesh(
            f"layout 'xatlas': parts of the surface lie over others on the texture after {TRIES} tries; "
            "use a coarser mesh, or bake with vertex colours"
        )
    return made


def _boxes(meshes: Sequence[BakeMesh], size: int, tiles: int, report: Progress) -> list[Unwrapped] | None:
    """Return a box atlas without overlaps, or None."""
    padding = 2.0 * gutter_width(size)
    return _without_overlaps(
        meshes, size, 0.0, report, lambda groups, tick: box_atlas(meshes, groups, size, tiles, padding, tick)
    )


def _without_overlaps(
    meshes: Sequence[BakeMesh],
    size: int,
    share: float,
    report: Progress,
    make: Callable[[list[Int64Array], Callable[..., None]], list[Unwrapped] | None],
) -> list[Unwrapped] | None:
    """Return a layout by groups of faces; those that lie over others become a group of their own.

    None: there is no such layout, or more than a share of the faces lies over others after all tries.
    """
    groups = [np.zeros(len(mesh.faces), np.int64) for mesh in meshes]
    for number in range(TRIES):
        tick = partial(_report_try, report, number)
        tick()
        made = make(groups, tick)
        if made is None:
            return None
        over = [_faces_over_others(mesh, part, size) for mesh, part in zip(meshes, made, strict=True)]
        if sum(map(len, over)) <= share * sum(map(len, groups)):
            return made
        for group, faces in zip(groups, over, strict=True):
            group[faces] = number + 1
    return None


def _report_try(report: Progress, number: int, share: float = 0.0) -> None:
    """Report a part of a try; each try counts as half of the rest of the work, as most layouts need one."""
    report(UNWRAPPING, 1.0 - 0.5**number * (1.0 - 0.5 * share))


def _faces_over_others(mesh: BakeMesh, part: Unwrapped, size: int) -> Int64Array:
    """Return the faces of a mesh that cover others on a texture: the later ones."""
    over: list[Int64Array] = [np.empty(0, np.int64)]
    last = len(part.faces) - 1
    look = min(size, LOOK_SIZE)
    places = part.places * np.float32(look / size)

    def cover(order: slice, tile: int) -> tuple[Int32Array, int]:
        turned = Unwrapped(part.rows, part.faces[order], places, part.tile_of_face[order])
        return Sheet(0, mesh, turned, tile).cover(look, INSET)

    for tile in np.unique(part.tile_of_face).tolist():
        below, twice = cover(slice(None), tile)
        if not twice:
            continue
        above, _ = cover(slice(None, None, -1), tile)
        covered = above >= 0
        faces = last - above[covered]
        over.append(np.unique(faces[faces != below[covered]]).astype(np.int64))
    return np.concatenate(over)


def own_layout(meshes: Sequence[BakeMesh], size: int, tiles: int) -> list[Unwrapped]:
    """Return the places that meshes have by their texture coordinates.

    With several meshes, each has a tile; with one tile, each has a cell of a square grid.

    Raises
    ------
    InvalidMesh
        A mesh has no coordinates, or they lie outside of [0, 1], have no area, or overlap.
    """
    spread = tiles >= len(meshes)
    cells = 1 if spread else int(np.ceil(np.sqrt(len(meshes))))
    unwrapped = []
    for number, mesh in enumerate(meshes):
        uv = _own_coordinates(mesh)
        cell = np.array([0, 0] if spread else [number % cells, number // cells], np.float32)
        places = (np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]) + cell) * np.float32(size / cells)
        tile = np.full(len(mesh.faces), number if spread else 0, np.int32)
        part = Unwrapped(np.arange(len(uv)), mesh.faces, places.astype(np.float32), tile)
        _check_own(mesh, part, size)
        unwrapped.append(part)
    return unwrapped


def _own_coordinates(mesh: BakeMesh) -> Float32Array:
    """Return texture coordinates within [0, 1] of a mesh."""
    uv = None if mesh.base is None else mesh.base.coordinates
    if uv is None:
        raise InvalidMesh(
            f"layout 'own': expected texture coordinates, object {mesh.name!r} has none; use layout='box'"
        )
    if uv.min() < -OUTSIDE or uv.max() > 1.0 + OUTSIDE:
        raise InvalidMesh(
            f"layout 'own': expected texture coordinates from 0 to 1, those of object {mesh.name!r} go from "
            f"{uv.min():.3g} to {uv.max():.3g}; use layout='box'"
        )
    return np.clip(uv, 0.0, 1.0)


def _check_own(mesh: BakeMesh, part: Unwrapped, size: int) -> None:
    """Raise InvalidMesh if own coordinates have no area, or overlap."""
    corners = part.places[part.faces].astype(np.float64)
    areas = np.abs(np.linalg.det(np.diff(corners, axis=1)))
    flat = int((areas <= 0.0).sum())
    if flat:
        raise InvalidMesh(
            f"layout 'own': {flat} of {len(areas)} faces of object {mesh.name!r} have no area in its texture "
            "coordinates; use layout='box'"
        )
    over = len(_faces_over_others(mesh, part, size))
    if over > MAX_OVERLAP * len(areas):
        raise InvalidMesh(
            f"layout 'own': {over} of {len(areas)} faces of object {mesh.name!r} lie over others in its "
            "texture coordinates, so decals on them would mix; use layout='box'"
        )


def _even_own(meshes: Sequence[BakeMesh], size: int, tiles: int) -> list[Unwrapped] | None:
    """Return the own layout of meshes if it can be used and spreads texels evenly, else None."""
    if any(mesh.base is None or mesh.base.coordinates is None for mesh in meshes):
        return None
    try:
        made = own_layout(meshes, size, tiles)
    except InvalidMesh:
        return None
    areas, texels = [], []
    for mesh, part in zip(meshes, made, strict=True):
        corners = mesh.vertices[mesh.faces].astype(np.float64)
        areas.append(np.linalg.norm(np.cross(*np.moveaxis(np.diff(corners, axis=1), 1, 0)), axis=1))
        texels.append(np.abs(np.linalg.det(np.diff(part.places[part.faces].astype(np.float64), axis=1))))
    area, own = np.concatenate(areas), np.concatenate(texels)
    density = own / area
    order = np.argsort(density)
    coarse = density[order][np.searchsorted(np.cumsum(area[order]), 0.1 * area.sum())]
    return made if own.sum() / area.sum() <= MAX_UNEVENNESS**2 * coarse else None
