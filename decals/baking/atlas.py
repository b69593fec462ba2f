"""Texture atlas: xatlas cuts meshes into charts and packs all charts into one square texture."""

import subprocess
import tempfile
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Int64Array
from blobtree.progress import Progress
from decals.baking.atlas_child import Arrays, atlas, packed, unpacked
from decals.baking.box_atlas import BoxSides
from decals.baking.fine_trees import EXPECTED_USE
from decals.baking.meshes import BakeMesh
from decals.baking.unwrapped import Unwrapped
from decals.child_process import can_isolate, kill, start_child
from decals.errors import InvalidMesh
from decals.surfaces.topology import components
from decals.validation import optional_package

UNWRAPPING = "unwrapping the surface"
"""Stage of progress reports."""

FACE_SECONDS = 3e-4
"""Usual seconds of xatlas for a face; xatlas reports nothing, so the fraction done is an estimate."""

REPORT_SECONDS = 0.1
"""Seconds between reports while xatlas works; a cancelled one ends as soon."""

PADDING = 4
"""Texels between charts. Packing is estimated before the atlas has its final size, so it may be fewer."""

MAX_CHART_FACES = 300.0
"""Largest area of a chart, in mean areas of a face. The time for a chart grows faster than its faces."""


LEVEL_COSINE = 1.0 - 2e-4
"""Least cosine between neighbours that xatlas may take for parts of one plane; its own is 1 − 1e-4."""

MIN_PLANE_COSINE = float(np.cos(np.radians(15.0)))
"""Least cosine between faces and their mean normal up to which they are one plane nearly enough."""


def bent_planes(mesh: BakeMesh, report: Progress) -> Int64Array:
    """Return for each face the part of a bent surface that xatlas takes for a plane, or 0, ``int64[m]``.

    xatlas compares the normals of neighbouring faces alone. A ball of 200,000 faces is a plane for it: it
    crashes, or presses both halves on one place. Parts are cut where the sides of a box meet.
    """
    sides = BoxSides.of(mesh, lambda: report(UNWRAPPING, 0.0))
    face, side = np.nonzero(sides.neighbors >= 0)
    links = np.stack([face, sides.neighbors[face, side]], axis=1)
    links = links[(sides.normals[links[:, 0]] * sides.normals[links[:, 1]]).sum(axis=1) >= LEVEL_COSINE]
    plane = components(links, len(sides.normals))
    report(UNWRAPPING, 0.0)
    sums = np.stack([np.bincount(plane, column) for column in sides.normals.T], axis=1)
    means = sums / np.maximum(np.linalg.norm(sums, axis=1), 1e-30)[:, None]
    least = np.ones(len(means))
    np.minimum.at(least, plane, (sides.normals * means[plane]).sum(axis=1))
    same_side = sides.axis[links[:, 0]] == sides.axis[links[:, 1]]
    parts = components(links[same_side], len(sides.normals))
    return np.where(least[plane] < MIN_PLANE_COSINE, parts + 1, 0)


def unwrap(
    meshes: Sequence[BakeMesh], size: int, report: Progress, groups: Sequence[Int64Array] | None = None
) -> list[Unwrapped]:
    """Return places for all meshes on one texture of ``size`` × ``size`` texels.

    All charts have about the same number of texels per area. Charts may be mirrored. A chart has faces of one
    group. While xatlas works, ``report`` is called repeatedly, with an estimate of the fraction done: a half
    after the usual time for so many faces. An error that it raises ends the work.

    Raises
    ------
    MissingPackage
        If xatlas is not installed.
    InvalidMesh
        If xatlas fails.
    """
    optional_package("xatlas", "bake")
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes]).astype(np.float64)
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # xatlas compares lengths and areas with absolute limits: give it faces of mean area 1.
    scale = 1.0 / np.sqrt(0.5 * np.linalg.norm(np.cross(*sides), axis=1).mean())
    center = corners.mean(axis=(0, 1))
    arrays: list[NDArray[Any]] = []
    pieces = []
    for number, mesh in enumerate(meshes):
        scaled = ((mesh.vertices - center) * scale).astype(np.float32)
        keys = bent_planes(mesh, report) + (0 if groups is None else groups[number] * (len(mesh.faces) + 1))
        for chosen in _equal(keys):
            if keys[chosen[0]]:
                chosen = _central_first(mesh, chosen)
            rows, faces = np.unique(mesh.faces[chosen], return_inverse=True)
            arrays += [scaled[rows], faces.reshape(-1, 3).astype(np.uint32), mesh.normals[rows]]
            pieces.append((number, chosen, rows))
    texels_per_unit = float(size * np.sqrt(EXPECTED_USE / len(corners)))
    page, *parts = _atlas([np.ascontiguousarray(array) for array in arrays], texels_per_unit, report)
    made = list(zip(pieces, parts[0::3], parts[1::3], parts[2::3], strict=True))
    unwrapped = []
    for number, mesh in enumerate(meshes):
        rows_of_mesh, places, faces_of_mesh, count = [], [], np.empty_like(mesh.faces), 0
        for (owner, chosen, used), rows, faces, uv in made:
            if owner == number:
                rows_of_mesh.append(used[rows.astype(np.int64)])
                places.append(uv * page * (size / page.max()))
                faces_of_mesh[chosen] = faces.astype(np.int32) + count
                count += len(rows)
        tiles = np.zeros(len(faces_of_mesh), np.int32)
        joined = np.concatenate(places).astype(np.float32)
        unwrapped.append(
            Unwrapped(np.concatenate(rows_of_mesh).astype(np.int64), faces_of_mesh, joined, tiles)
        )
    return unwrapped


def _equal(keys: Int64Array) -> list[Int64Array]:
    """Return the rows of each key, in order."""
    order = np.argsort(keys, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(keys[order])) + 1)


def _central_first(mesh: BakeMesh, chosen: Int64Array) -> Int64Array:
    """Return faces from the one whose normal is the mean: xatlas projects planes along their first normal."""
    normals = mesh.normals[mesh.faces[chosen]].sum(axis=1)
    return np.roll(chosen, -int((normals @ normals.sum(axis=0)).argmax()))


def _atlas(arrays: Arrays, texels_per_unit: float, report: Progress) -> Arrays:
    """Call `atlas` in a process of its own, where there can be one."""
    report(UNWRAPPING, 0.0)
    options = texels_per_unit, MAX_CHART_FACES, PADDING
    if not can_isolate():
        return atlas(arrays, *options)
    with tempfile.TemporaryFile() as request:  # `communicate` may not end if it has input and a timeout
        request.write(packed([*map(np.asarray, options), *arrays]))
        request.seek(0)
        child = start_child(atlas.__module__, stdin=request, stderr=subprocess.PIPE)
    began, usual = time.monotonic(), FACE_SECONDS * sum(map(len, arrays[1::3]))
    with child:
        try:
            while True:
                try:
                    answer, errors = child.communicate(timeout=REPORT_SECONDS)
                    break
                except subprocess.TimeoutExpired:
                    taken = time.monotonic() - began
                    report(UNWRAPPING, taken / (taken + usual))
        except BaseException:
            kill(child)
            raise
    if child.returncode:
        reason = errors.decode(errors="replace").strip().splitlines()[-1:] or [
            f"exit code {child.returncode}"
        ]
        raise InvalidMesh(
            f"xatlas could not unwrap the surface ({reason[0]}); repair the mesh, use layout='box', "
            "or bake with vertex colours"
        )
    return unpacked(answer)
