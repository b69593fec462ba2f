"""Texture atlas: xatlas cuts meshes into charts and packs all charts into one square texture."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree.progress import Progress
from decals.baking.atlas_child import Arrays, atlas, packed, unpacked
from decals.baking.meshes import BakeMesh
from decals.baking.unwrapped import Unwrapped
from decals.errors import InvalidMesh
from decals.surfaces.vtk_process import can_isolate
from decals.validation import optional_package

UNWRAPPING = "unwrapping the surface"
"""Stage of progress reports."""

REPORT_SECONDS = 0.1
"""Seconds between reports while xatlas works; a cancelled one ends as soon."""

PADDING = 4
"""Texels between charts. Packing is estimated before the atlas has its final size, so it may be fewer."""

MAX_CHART_FACES = 300.0
"""Largest area of a chart, in mean areas of a face. The time for a chart grows faster than its faces."""

EXPECTED_USE = 0.6
"""Part of the texture that charts are expected to cover, for the first estimate of their scale."""


def unwrap(meshes: Sequence[BakeMesh], size: int, report: Progress) -> list[Unwrapped]:
    """Return places for all meshes on one texture of ``size`` × ``size`` texels.

    All charts have about the same number of texels per area. Charts do not overlap, but may be mirrored.
    While xatlas works, ``report`` is called repeatedly; an error that it raises ends the work.

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
    for mesh in meshes:
        scaled = np.ascontiguousarray((mesh.vertices - center) * scale, np.float32)
        arrays += [scaled, mesh.faces.astype(np.uint32), np.ascontiguousarray(mesh.normals, np.float32)]
    texels_per_unit = float(size * np.sqrt(EXPECTED_USE / len(corners)))
    page, *parts = _atlas(arrays, texels_per_unit, report)
    unwrapped = []
    for rows, faces, uv in zip(parts[0::3], parts[1::3], parts[2::3], strict=True):
        places = uv * page * (size / page.max())
        tiles = np.zeros(len(faces), np.int32)
        unwrapped.append(
            Unwrapped(rows.astype(np.int64), faces.astype(np.int32), places.astype(np.float32), tiles)
        )
    return unwrapped


def _atlas(arrays: Arrays, texels_per_unit: float, report: Progress) -> Arrays:
    """Call `atlas` in a process of its own, where there can be one."""
    report(UNWRAPPING, 0.0)
    options = texels_per_unit, MAX_CHART_FACES, PADDING
    if not can_isolate():
        return atlas(arrays, *options)
    folders = os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path)
    with tempfile.TemporaryFile() as request:  # `communicate` may not end if it has input and a timeout
        request.write(packed([*map(np.asarray, options), *arrays]))
        request.seek(0)
        child = subprocess.Popen(
            [sys.executable, "-P", "-W", "ignore", "-m", atlas.__module__],
            stdin=request,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": folders},
        )
    with child:
        try:
            while True:
                try:
                    answer, errors = child.communicate(timeout=REPORT_SECONDS)
                    break
                except subprocess.TimeoutExpired:
                    report(UNWRAPPING, 0.0)
        except BaseException:
            child.kill()
            raise
    if child.returncode:
        reason = errors.decode(errors="replace").strip().splitlines()[-1:] or [
            f"exit code {child.returncode}"
        ]
        raise InvalidMesh(
            f"xatlas could not unwrap the surface ({reason[0]}); repair the mesh, or bake with vertex colours"
        )
    return unpacked(answer)
