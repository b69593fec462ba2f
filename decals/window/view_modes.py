"""Modes, overlays and field slices of a view, as data sets of pyvista."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv

from decals.editing.document import Document
from decals.editing.overlays import contact_lines, sample_surface
from decals.editing.slicing import SlicePlane
from decals.field.evaluate import evaluate
from decals.field.walks import evaluation_options
from decals.scenes.objects import TreeObject, bounds_of
from decals.surfaces.surface import unit_rows

MODES = "traced", "polygonized", "wireframe", "normals", "curvature"
OVERLAYS = "none", "contact lines", "owners", "stretch", "folds", "seeds"
RESOLUTION = 96
"""Cells along the longest side of the meshes that modes and overlays use."""

CUTS = 2 * RESOLUTION
"""Cells along a side of a slice of decals."""

LIFT = 0.003
"""Distance of overlays above the surface, in sizes of the scene, so that they are not hidden."""

OWNER_COLORS = np.array(
    [(230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66), (0, 114, 178), (204, 121, 167)], np.uint8
)
"""Colours of owners in turn, after Okabe and Ito: they differ for people with colour-blindness, too."""

NO_OWNER = (150, 150, 150)
SHOWN_FIELD = 0.002
"""Least field of trees that the slice shows."""

RIM_FIELD = 0.5
"""Field of a decal at the rim of its image; it is larger inside, and there is no field outside."""

FIELD_LOOK = {"scalars": "field", "cmap": "cividis", "clim": (0.0, 1.0), "lighting": False}
"""How a slice shows a field."""

FOLD_COLOR = "#d55e00"
LINE_COLOR = "#111111"
MAX_STRETCH = 5.0
"""Upper end of the colours of stretch."""

PREFIX = "decals-view "
"""First part of the names of their actors."""


@dataclass(frozen=True)
class DisplayOptions:
    """What the view shows besides the scene itself.

    Attributes
    ----------
    mode, overlay
        One of `MODES`, and of `OVERLAYS`.
    slice
        The plane that cuts the model open, if one does.
    """

    mode: str = MODES[0]
    overlay: str = OVERLAYS[0]
    slice: SlicePlane | None = None


Shown = list[tuple[str, Any, dict[str, Any]]]
"""Data sets with their names and pyvista's options."""


def shown_data(document: Document, parts: list[pv.PolyData], options: DisplayOptions) -> tuple[Shown, str]:
    """Return the data sets that show a document, and a message with their measures.

    Parameters
    ----------
    document
        The document.
    parts
        Meshes of its objects, with colours and normals.
    options
        Mode, overlay and slice.
    """
    low, high = bounds_of(document.objects)
    size = float((high - low).max())
    first, *others = parts
    mesh = first.append_polydata(*others) if others else first
    shown: Shown = []
    message = ""
    if options.slice is not None:
        shown += _sliced(document, mesh, options.slice, size)
    elif options.mode not in MODES[:2]:
        shown.append(_moded(document, mesh, parts, options.mode))
    if options.overlay != OVERLAYS[0]:
        overlay, message = _overlay(document, mesh, options.overlay, LIFT * size)
        shown += overlay
    return shown, message


def example_data() -> Shown:
    """Return a triangle in each way in which modes, overlays and slices draw, with a scale of colours.

    Drivers compile VTK's programs for each way when it is drawn first.
    """
    plain = pv.PolyData(np.eye(3), [3, 0, 1, 2])  # without normals
    plain["level"], plain["colour"] = np.zeros(3), np.zeros((3, 3), np.uint8)
    plain.cell_data["level of the cell"] = np.zeros(1)
    triangle = plain.copy()
    triangle["Normals"] = np.eye(3)
    triangle.point_data.active_normals_name = "Normals"
    lines = pv.PolyData(np.eye(3), lines=[2, 0, 1])
    scale, colors = (
        {"scalars": "level", "cmap": "cividis", "clim": (0.0, 1.0)},
        {"scalars": "colour", "rgb": True},
    )
    ways: list[tuple[pv.PolyData, dict[str, Any]]] = [
        (triangle, scale),
        (plain, scale | {"lighting": False}),
        (plain, scale | {"lighting": False, "scalars": "level of the cell"}),
        (plain, colors),
        (triangle, colors),
        (triangle, colors | {"smooth_shading": True}),
        (triangle, colors | {"lighting": False}),
        (triangle, {"style": "wireframe", "color": LINE_COLOR}),
        (triangle, {"style": "points", "color": LINE_COLOR, "render_points_as_spheres": True}),
        (lines, {"color": LINE_COLOR, "line_width": 3}),
    ]
    return [(f"{PREFIX}example {number}", data, given) for number, (data, given) in enumerate(ways)]


def _moded(document: Document, mesh: pv.PolyData, parts: list[pv.PolyData], mode: str) -> Any:
    """Return the mesh of a mode with its name and options."""
    name = f"{PREFIX}mesh"
    if mode == "wireframe":
        return name, mesh, {"style": "wireframe", "color": "#30506a", "line_width": 1}
    copy = mesh.copy(deep=False)
    if mode == "normals":
        copy["normal colours"] = np.round(127.5 * (np.asarray(mesh["Normals"]) + 1.0)).astype(np.uint8)
        return name, copy, {"scalars": "normal colours", "rgb": True, "lighting": False}
    curvatures = [
        np.asarray(item.tree.curvatures(np.asarray(part.points, np.float32)).mean)
        if isinstance(item, TreeObject)
        else np.asarray(part.curvature("mean"))
        for item, part in zip(document.objects, parts, strict=True)
    ]
    copy["mean curvature"] = np.concatenate(curvatures)
    reach = float(np.nanpercentile(np.abs(copy["mean curvature"]), 95)) or 1.0
    return name, copy, {"scalars": "mean curvature", "cmap": "PuOr", "clim": (-reach, reach)}


def _sliced(document: Document, mesh: pv.PolyData, cut: SlicePlane, size: float) -> Shown:
    """Return the part of the mesh behind a plane, and the fields of the trees on it with iso-lines.

    Without trees, return the fields of the decals on the plane, through the whole scene.
    """
    if not any(isinstance(item, TreeObject) for item in document.objects):
        return _decals_sliced(document, cut, size)
    clipped = mesh.clip(normal=cut.normal, origin=cut.point)
    shown: Shown = []
    if clipped.n_points:
        shown.append((f"{PREFIX}mesh", clipped, {"scalars": "RGB", "rgb": True, "smooth_shading": True}))
    for number, item in enumerate(document.objects):
        if not isinstance(item, TreeObject):
            continue
        field: Any = item.tree.slice(cut.point, cut.normal, resolution=RESOLUTION)
        inside = field["plane"].clip_scalar(scalars="field", value=SHOWN_FIELD, invert=False)
        shown.append((f"{PREFIX}plane {number}", inside, FIELD_LOOK))
        for part, width in (("lines", 1), ("surface", 4)):
            if field[part].n_points:
                lifted = field[part].translate(LIFT * size * np.array(cut.normal))
                shown.append((f"{PREFIX}{part} {number}", lifted, {"color": "white", "line_width": width}))
    return shown


def _decals_sliced(document: Document, cut: SlicePlane, size: float) -> Shown:
    """Return the outline of a plane, and its part inside decals with their field after contact."""
    middle = cut.nearest(np.add(*bounds_of(document.objects)) / 2)
    plane: Any = pv.Plane(
        center=middle, direction=cut.normal, i_size=size, j_size=size, i_resolution=CUTS, j_resolution=CUTS
    )
    points = np.asarray(plane.points, np.float32)
    modes = evaluation_options(document.drawing, document.decals, document.objects)
    plane["field"] = evaluate(document.decals, points, np.zeros_like(points), **modes).field
    inside = plane.clip_scalar(scalars="field", value=RIM_FIELD / 2, invert=False)
    shown: Shown = [(f"{PREFIX}outline", plane.outline(), {"color": LINE_COLOR, "line_width": 2})]
    return shown + ([(f"{PREFIX}plane", inside, FIELD_LOOK)] if inside.n_points else [])


def _overlay(document: Document, mesh: pv.PolyData, overlay: str, lift: float) -> tuple[Shown, str]:
    """Return the data sets of an overlay, and what it measures."""
    name = f"{PREFIX}overlay"
    points, normals = np.asarray(mesh.points, np.float32), np.asarray(mesh["Normals"], np.float32)
    if overlay == "seeds":
        chosen = document.decals.decals
        if not len(chosen):
            return [], "no decals"
        lifted = pv.PolyData(chosen.positions + 2.0 * lift * chosen.normals)
        options = {"color": LINE_COLOR, "point_size": 7, "render_points_as_spheres": True}
        return [(name, lifted, options)], f"{len(chosen)} seeds"
    triangles = mesh.regular_faces
    faces, above, normals = triangles.astype(np.int32), points + lift * normals, unit_rows(normals)
    if overlay == "contact lines":
        lines = contact_lines(document, points, normals, faces, lift=lift)
        if not len(lines):
            return [], "no decals touch"
        cells = np.column_stack([np.full(len(lines), 2), np.arange(2 * len(lines)).reshape(-1, 2)])
        drawn = pv.PolyData(lines.reshape(-1, 3), lines=cells.ravel())
        return [(name, drawn, {"color": LINE_COLOR, "line_width": 3})], ""
    samples = sample_surface(document, points, normals, faces)
    lifted = pv.PolyData.from_regular_faces(above, triangles)
    if overlay == "owners":
        colors = OWNER_COLORS[samples.owners % len(OWNER_COLORS)]
        lifted["owners"] = np.where((samples.owners >= 0)[:, None], colors, NO_OWNER).astype(np.uint8)
        shown_count = len(np.unique(samples.owners[samples.owners >= 0]))
        return [(name, lifted, {"scalars": "owners", "rgb": True})], f"{shown_count} decals show"
    folded = int(samples.folds.sum())
    if overlay == "folds":
        message = f"{folded} of {len(faces)} triangles folded"
        if not folded:
            return [], message
        shown = name, lifted.extract_cells(samples.folds), {"color": FOLD_COLOR, "lighting": False}
        return [shown], message
    known = np.isfinite(samples.stretch)
    if not known.any():
        return [], "no decals to measure"
    lifted.cell_data["stretch"] = samples.stretch
    part = lifted.extract_cells(known)
    typical, worst = np.percentile(samples.stretch[known], (50, 95))
    options = {"scalars": "stretch", "cmap": "cividis", "clim": (1.0, MAX_STRETCH), "lighting": False}
    return [(name, part, options)], f"stretch: median {typical:.2f}, 95 % below {worst:.2f}"
