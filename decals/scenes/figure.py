"""Figures of scenes in SVG and PDF: contact lines, rims and edges of models, without hidden lines."""

import base64
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from blobtree._typing import BoolArray, Float64Array
from blobtree.files import replacing, write_atomically
from blobtree.progress import Progress, reporting
from blobtree.validation import describe, finite_number, items, truth
from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
from decals.scenes.camera import Camera
from decals.scenes.objects import MeshObject, SceneObject, bounds_of
from decals.scenes.outlines import STEP, LineKind, chains, outlines
from decals.scenes.render import render
from decals.scenes.scene import Scene, require_scene
from decals.surfaces.mesh import edges_of
from decals.validation import allowed_number, checked_path, instance, optional_package

SUFFIXES = (".svg", ".pdf")

MODEL = "model"
"""Kind of the edges of models."""

WIDTHS: dict[str, float] = {LineKind.CONTACT.value: 0.8, LineKind.RIM.value: 0.5, MODEL: 0.35}
"""Default widths of lines in points."""

MAX_POINTS, MAX_WIDTH = 14_400.0, 100.0
"""Largest side of a figure and largest width of lines, in points."""

PIXELS_PER_POINT = 2.0
"""Resolution of a picture behind the lines."""

NEAR = 2e-3
"""Distance by which surface may lie before a line without hiding it, in lengths of the model."""

MODEL_CELL = 1.0 / 128.0
"""Cells of the mesh of a BlobTree on which its silhouette is found, in lengths of the tree."""


@dataclass(frozen=True, eq=False)
class _Stroke:
    """A visible line of a figure: its kind, and its points from the upper left, in points ``[k, 2]``."""

    kind: str
    points: Float64Array


@dataclass(frozen=True, eq=False)
class _Line:
    """A polyline in space: its kind, its points, and points before it that are seen if it is; ``[k, 3]``."""

    kind: str
    points: Float64Array
    probes: Float64Array


def save_figure(
    scene: Scene,
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] = (360.0, 270.0),
    widths: Mapping[str, float] | None = None,
    picture: bool = False,
    camera: Camera | None = None,
    contact: AnyContact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    step: float = STEP,
    progress: Progress | None = None,
) -> None:
    """Write a figure of a scene as lines, for papers: what its camera sees, without hidden lines.

    Lines are those of `outlines`, and the silhouettes, creases and boundaries of models.

    Parameters
    ----------
    scene : Scene
        The scene.
    path : str or path
        The file, named ``.svg`` or ``.pdf``. PDF needs the extra ``experiments``.
    size : (float, float)
        Width and height in points, of which 72 are an inch.
    widths : mapping, optional
        Width in points of the lines of each kind: ``"contact"``, ``"rim"`` and ``"model"``. Kinds of width 0
        are left out. Defaults: 0.8, 0.5 and 0.35.
    picture : bool
        True draws the rendered picture behind the lines, with two pixels a point.
    camera : Camera, optional
        Camera in place of that of the scene.
    contact, stiffness, mapping, step : optional
        See `outlines`.
    progress : callable, optional
        Called with the name of the stage and the fraction done.

    Raises
    ------
    InvalidScene
        No scene, a posed scene, a path that cannot be written, or an option out of range.
    MissingPackage
        matplotlib is not installed, which writes PDF.
    NoGraphics
        A picture without OpenGL.

    See Also
    --------
    decals.outlines : the lines in space.

    Examples
    --------
    >>> import pathlib, blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> decals.save_figure(scene, "ball.svg", size=(120, 90), widths={"model": 0})
    >>> pathlib.Path("ball.svg").read_text()[:4]
    '<svg'
    """
    require_scene("scene", scene, "draw the scene that was posed, where its decals lie")
    target = checked_path(path, SUFFIXES)
    page = _page(size)
    thickness, pictured = _widths(widths), truth("picture", picture, InvalidScene)
    if not scene.objects:
        raise InvalidScene("expected a scene with an object to draw, got none; add one")
    modes = scene.drawing.overridden(contact=contact, stiffness=stiffness, mapping=mapping).modes
    if camera is not None:
        scene = scene.replace(camera=instance("camera", camera, Camera, InvalidScene, "give a Camera"))
    if target.suffix.lower() == ".pdf":
        optional_package("matplotlib", "experiments")
    with reporting(progress) as report:
        shown = [kind for kind, width in thickness.items() if width > 0.0]
        view = _View(scene, page)
        lines: list[_Line] = []
        if set(shown) - {MODEL}:
            found = outlines(scene, **modes, step=step, progress=report)
            lines += [
                _Line(line.kind.value, points := line.points.astype(np.float64), points) for line in found
            ]
        report("removing hidden lines", 0.0)
        if MODEL in shown:
            lines += [line for item in scene.objects for line in _edges(item, view)]
        strokes = list(view.strokes([line for line in lines if line.kind in shown]))
        image = None
        if pictured:
            pixels = tuple(max(1, round(PIXELS_PER_POINT * side)) for side in page)
            image = render(scene, size=(pixels[0], pixels[1]), **modes)
        write = _write_svg if target.suffix.lower() == ".svg" else _write_pdf
        write(target, page, thickness, strokes, image)


def _page(size: object) -> tuple[float, float]:
    """Return a checked size of a figure."""
    sides = items(size)
    if sides is None or len(sides) != 2:
        raise InvalidScene(f"size: expected a width and a height in points, got {describe(size)}")
    width, height = (finite_number("size", side, InvalidScene) for side in sides)
    if not (0.0 < width <= MAX_POINTS and 0.0 < height <= MAX_POINTS):
        raise InvalidScene(f"size: expected sides from 0 to {MAX_POINTS:g} points, got {describe(size)}")
    return width, height


def _widths(widths: object) -> dict[str, float]:
    """Return the checked widths of all kinds of lines."""
    if widths is None:
        return dict(WIDTHS)
    if not isinstance(widths, Mapping):
        raise InvalidScene(f"widths: expected widths in points by kind, got {describe(widths)}")
    unknown = [kind for kind in widths if kind not in WIDTHS]
    if unknown:
        raise InvalidScene(f"widths: expected the kinds {', '.join(WIDTHS)}, got {describe(unknown[0])}")
    expected = f"points from 0 to {MAX_WIDTH:g}"
    return WIDTHS | {
        kind: allowed_number(
            f"width of {kind}", width, expected, lambda value: 0 <= value <= MAX_WIDTH, InvalidScene
        )
        for kind, width in widths.items()
    }


class _View:
    """The camera's view of a scene on a page."""

    def __init__(self, scene: Scene, page: tuple[float, float]) -> None:
        camera = scene.camera.at(page[0] / page[1])
        self.eye = np.array(camera.position, np.float64)
        self._matrix = camera.projection(page[0] / page[1], 1.0, 2.0) @ camera.view()
        self._page = np.array(page)
        self._surfaces = [item.surface for item in scene.objects]
        low, high = bounds_of(scene.objects)
        self.near = NEAR * float(np.linalg.norm(high - low))

    def strokes(self, lines: Sequence[_Line]) -> Iterator[_Stroke]:
        """Yield the visible parts of polylines."""
        if not lines:
            return
        points, probes = (
            np.concatenate([getattr(line, name) for line in lines]) for name in ("points", "probes")
        )
        places, seen = self._seen(points, probes)
        last = np.cumsum([len(line.points) for line in lines])
        for line, page, flags in zip(lines, np.split(places, last), np.split(seen, last), strict=False):
            starts = np.flatnonzero(flags & ~np.concatenate([[False], flags[:-1]]))
            ends = np.flatnonzero(flags & ~np.concatenate([flags[1:], [False]])) + 1
            for start, end in zip(starts, ends, strict=True):
                if end - start > 1:
                    yield _Stroke(line.kind, page[start:end])

    def _seen(self, points: Float64Array, probes: Float64Array) -> tuple[Float64Array, BoolArray]:
        """Return the places of points on the page, and True for those whose probes can be seen."""
        clip = np.column_stack([points, np.ones(len(points))]) @ self._matrix.T
        ahead = clip[:, 3] > 1e-6 * max(float(np.abs(clip[:, 3]).max()), 1e-30)
        places = clip[:, :2] / np.where(ahead, clip[:, 3], 1.0)[:, None]
        near = ahead & (np.abs(places) <= 2.0).all(axis=1)
        seen = near.copy()
        seen[near] = self._unhidden(probes[near])
        return (0.5 + 0.5 * places * [1.0, -1.0]) * self._page, seen

    def _unhidden(self, points: Float64Array) -> BoolArray:
        """Return True for points that no surface hides."""
        ways = points - self.eye
        distances = np.linalg.norm(ways, axis=1)
        origins = np.broadcast_to(self.eye, points.shape).astype(np.float32)
        headings = (ways / np.maximum(distances, 1e-300)[:, None]).astype(np.float32)
        hits = np.full(len(points), np.inf)
        for surface in self._surfaces:
            hits = np.minimum(hits, surface.raycast(origins, headings))
        unhidden: BoolArray = hits >= distances - self.near
        return unhidden


def _edges(item: SceneObject, view: _View) -> Iterator[_Line]:
    """Yield the silhouettes, creases and boundaries of a model; probes lie a little outside of it."""
    if isinstance(item, MeshObject):
        surface, angle = item.surface, item.crease_angle
    else:
        low, high = item.bounds
        surface, angle = item.surface.triangulated(MODEL_CELL * float((high - low).max())), 180.0
    edges = edges_of(surface)
    toward = view.eye - edges.vertices[edges.ends[:, 0]]
    facing = np.einsum("kfi,ki->kf", edges.normals, toward) > 0.0
    cosines = np.einsum("ki,ki->k", *np.moveaxis(edges.normals, 1, 0))
    drawn = (edges.counts != 2) | (facing[:, 0] != facing[:, 1]) | (cosines < np.cos(np.radians(angle)))
    outward = np.zeros_like(edges.vertices)
    for side in (0, 1):
        np.add.at(outward, edges.ends[:, side], edges.normals.sum(axis=1))
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-30)
    probes = edges.vertices + view.near * outward
    segments = [(first, second) for first, second in edges.ends[drawn].tolist()]
    for nodes in chains(segments):
        yield _Line(MODEL, _dense(edges.vertices[nodes]), _dense(probes[nodes]))


def _dense(points: Float64Array, parts: int = 12) -> Float64Array:
    """Return a polyline with points between its own ones, where parts of it may be hidden."""
    if len(points) > 4 * parts:
        return points
    shares = np.arange(parts) / parts
    between = points[:-1, None] + shares[:, None] * np.diff(points, axis=0)[:, None]
    return np.concatenate([between.reshape(-1, 3), points[-1:]])


def _write_svg(
    path: Path, page: tuple[float, float], widths: Mapping[str, float], strokes: list[_Stroke], picture: Any
) -> None:
    width, height = (f"{side:g}" for side in page)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}pt" height="{height}pt" '
        f'viewBox="0 0 {width} {height}">'
    ]
    if picture is not None:
        content = io.BytesIO()
        Image.fromarray(np.asarray(picture)).save(content, format="png")
        data = base64.b64encode(content.getvalue()).decode()
        parts.append(f'<image width="{width}" height="{height}" href="data:image/png;base64,{data}"/>')
    for kind in (MODEL, LineKind.RIM.value, LineKind.CONTACT.value):
        paths = ["M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in s.points) for s in strokes if s.kind == kind]
        if paths:
            parts.append(
                f'<path id="{kind}" fill="none" stroke="black" stroke-width="{widths[kind]:g}" '
                f'stroke-linecap="round" stroke-linejoin="round" d="{"".join(paths)}"/>'
            )
    write_atomically(path, "\n".join([*parts, "</svg>\n"]).encode())


def _write_pdf(
    path: Path, page: tuple[float, float], widths: Mapping[str, float], strokes: list[_Stroke], picture: Any
) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    figure = Figure(figsize=(page[0] / 72.0, page[1] / 72.0))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, page[0]), ylim=(page[1], 0.0))
    axes.axis("off")
    if picture is not None:
        axes.imshow(np.asarray(picture), extent=(0.0, page[0], page[1], 0.0), aspect="auto")
    for number, kind in enumerate((MODEL, LineKind.RIM.value, LineKind.CONTACT.value), 2):
        lines = [stroke.points for stroke in strokes if stroke.kind == kind]
        ends: dict[str, Any] = {"capstyle": "round", "joinstyle": "round", "zorder": number}
        axes.add_collection(LineCollection(lines, colors="black", linewidths=widths[kind], **ends))
    with replacing(path) as temporary:
        figure.savefig(temporary, format="pdf", metadata={"CreationDate": None})
