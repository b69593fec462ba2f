"""Texture atlas: xatlas cuts meshes into charts and packs all charts into one square texture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float32Array, Int32Array, Int64Array
from decals.baking.meshes import BakeMesh
from decals.validation import optional_package

PADDING = 4
"""Texels between charts. Packing is estimated before the atlas has its final size, so it may be fewer."""

MAX_CHART_FACES = 300.0
"""Largest area of a chart, in mean areas of a face. The time for a chart grows faster than its faces."""

EXPECTED_USE = 0.6
"""Part of the texture that charts are expected to cover, for the first estimate of their scale."""


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """A mesh on a texture; a vertex on the border of charts has a copy for each chart.

    Attributes
    ----------
    rows : int64[k]
        Vertex of the mesh from which each vertex was copied.
    faces : int32[m, 3]
        Corner indices of the faces, in the order of the mesh.
    places : float32[k, 2]
        Positions on the texture in texels: x to the right, y down from the upper left corner.
    """

    rows: Int64Array
    faces: Int32Array
    places: Float32Array


def unwrap(meshes: Sequence[BakeMesh], size: int) -> list[Unwrapped]:
    """Return places for all meshes on one texture of ``size`` × ``size`` texels.

    All charts have about the same number of texels per area. Charts do not overlap, but may be mirrored.

    Raises
    ------
    MissingPackage
        If xatlas is not installed.
    """
    xatlas = optional_package("xatlas", "bake")
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes]).astype(np.float64)
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # xatlas compares lengths and areas with absolute limits: give it faces of mean area 1.
    scale = 1.0 / np.sqrt(0.5 * np.linalg.norm(np.cross(*sides), axis=1).mean())
    center = corners.mean(axis=(0, 1))
    atlas = xatlas.Atlas()
    for mesh in meshes:
        scaled = np.ascontiguousarray((mesh.vertices - center) * scale, np.float32)
        atlas.add_mesh(scaled, mesh.faces.astype(np.uint32), mesh.normals)
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    charts.max_chart_area = MAX_CHART_FACES
    packing.padding = PADDING
    packing.texels_per_unit = float(size * np.sqrt(EXPECTED_USE / len(corners)))
    # Without a fixed resolution all charts lie on one page of about the right size, scaled afterwards.
    packing.resolution = 0
    atlas.generate(charts, packing)
    page = np.array([atlas.width, atlas.height], np.float64)
    unwrapped = []
    for number in range(len(meshes)):
        rows, faces, uv = atlas.get_mesh(number)
        places = uv * page * (size / page.max())
        unwrapped.append(Unwrapped(rows.astype(np.int64), faces.astype(np.int32), places.astype(np.float32)))
    return unwrapped
