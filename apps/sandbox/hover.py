"""What the pointer is at: its rows in the outline, and the shape of a row in the view."""

from contextlib import suppress
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree import Node, polygonize
from blobtree._typing import Float32Array, Float64Array
from blobtree.nodes.paths import node_in_world
from decals.editing.document import Document
from decals.editing.outline_actions import Part
from decals.editing.queries import SurfacePick
from decals.errors import ImplicitDecalsError
from decals.scenes.objects import TreeObject
from decals.window import EditWindow
from decals.window.host_plotter import pixels_of
from decals.window.overlay import box_edges

MAX_DOTS = 300
"""Most decals of a row that get a dot."""

TOP = 0.6
"""Distance of the top of an image from its centre, in radii of the decal, to which an arrow leads."""

KIND = "kind "
"""First part of the key of a row of the menu of kinds."""

VIEW = " view "
"""What parts a kind from the place of the view at which it is shown."""

GHOST_RESOLUTION = 10
"""Cells along the longest side of the shape that would be added."""

NOTHING: dict[str, Any] = {"rows": [], "lines": [], "dots": []}
"""Values of a page while the pointer is at nothing."""


class Hover:
    """Lights up rows for a place of the view, and the place in the view for a row.

    Parameters
    ----------
    window
        The edited window.
    """

    def __init__(self, window: EditWindow) -> None:
        self._window = window
        self._rows: list[str] = []
        self._key = ""
        self._put: tuple[ArrayLike | None, float | None] = None, None
        self._known: tuple[object, ...] = ()
        self._lines, self._dots = np.zeros((0, 2, 3), np.float32), np.zeros((0, 3, 3), np.float32)

    def at_place(self, pick: SurfacePick | None) -> None:
        """Light up the rows of the primitive and of the layer of the decal at a surface point."""
        self._key, self._rows = "", []
        if pick is not None:
            nodes = self._window.actions.trees.nodes_at(pick)[:1]
            self._rows = [Part("node", *place).key for place in nodes]
            if pick.owner >= 0:
                layer = int(self._window.document.decals[pick.owner].layers[0])
                self._rows.append(Part("layer", layer).key)

    def at_row(self, key: str, at: ArrayLike | None = None, reach: float | None = None) -> None:
        """Light up the box of a row's node or object, or its decals; "" lights up nothing.

        "kind Torus" lights up the box of the node that the menu would add; at a point of the scene its shape,
        of a reach from there.
        """
        self._key, self._rows, self._put = str(key), [], (at, reach)

    def values(self) -> dict[str, Any]:
        """Return the keys of the lit rows; and lines and dots in parts of the view, which cost no frame.

        A dot has two more numbers: the place toward which the top of the decal's image points.
        """
        if not self._key:
            return {**NOTHING, "rows": self._rows}
        document = self._window.document
        shown = self._key, document.objects, document.decals.version
        if shown != self._known:
            self._known = shown
            self._lines, self._dots = self._lines[:0], self._dots[:0]
            with suppress(ImplicitDecalsError):  # the scene need not have what a page asks for
                if self._key.startswith(KIND):
                    self._lines = self._ghost_of(self._key.removeprefix(KIND))
                elif (part := Part.named(self._key)).kind in ("layer", "image"):
                    self._dots = _decals_of(document, part)
                else:
                    self._lines = _box_of(document, part)
        return self._placed()

    def _ghost_of(self, kind: str) -> Float32Array:
        """Return lines of the node that the menu of a kind would add, shape (n, 2, 3)."""
        make = self._window.actions.trees.node_in_view(kind.partition(VIEW)[0], *self._put)
        box = self._put[0] is None
        found = self._window.actions.state.asked("place a node", lambda _document: _drawn(make(), box=box))
        if found is None:  # a thread compiles its kernels; the next call asks again
            self._known = ()
            return self._lines
        return found

    def _placed(self) -> dict[str, Any]:
        """Return lines and dots where they lie in the view."""
        eye = np.asarray(self._window.camera.eye_and_target()[0])
        facing = ((eye - self._dots[:, 0]) * self._dots[:, 2]).sum(axis=1) > 0.0
        return {
            "rows": [],
            "lines": self._in_view(self._lines),
            "dots": self._in_view(self._dots[facing][:MAX_DOTS, :2]),
        }

    def _in_view(self, pairs: Float32Array) -> list[list[float]]:
        """Return pairs of points (n, 2, 3), where both are in front of the eye, as places of the view."""
        rows = in_view(self._window, pixels_of(self._window.subplot, pairs.reshape(-1, 3))).reshape(-1, 4)
        listed: list[list[float]] = rows[np.isfinite(rows).all(axis=1)].tolist()
        return listed


def in_view(window: EditWindow, pixels: ArrayLike) -> Float64Array:
    """Return pixels (n, 2) as parts of the view's width, and of its height from the top."""
    places = (np.asarray(pixels, np.float64).reshape(-1, 2) + 0.5) / window.plotter.window_size
    return np.asarray(places * (1, -1) + (0, 1), np.float64).round(4)


def _drawn(node: Node, *, box: bool) -> Float32Array:
    return np.stack(box_edges(*node.bounds)) if box else outlines(node)


@lru_cache(maxsize=64)
def outlines(node: Node) -> Float32Array:
    """Return the edges of a coarse mesh of a node, shape (n, 2, 3); those of its box if it has no mesh."""
    mesh = polygonize(node, resolution=GHOST_RESOLUTION)
    if not len(mesh.faces):
        return np.stack(box_edges(*node.bounds))
    pairs = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.asarray(mesh.vertices, np.float32)[np.unique(pairs, axis=0)]


def _box_of(document: Document, part: Part) -> Float32Array:
    """Return the edges of the box of a node or an object, shape (12, 2, 3)."""
    item = document.object(part.number)
    shown = node_in_world(item.tree, part.path) if isinstance(item, TreeObject) else item
    return np.stack(box_edges(*shown.bounds))


def _decals_of(document: Document, part: Part) -> Float32Array:
    """Return centres, tops and normals of the decals of a layer, or of those with an image, (n, 3, 3)."""
    column = {"layer": "layers", "image": "images"}[part.kind]
    decals = document.decals.decals[document.decals.column(column) == part.number]
    tops = decals.positions + TOP * decals.radii[:, None] * decals.bitangents
    return np.stack([decals.positions, tops, decals.normals], axis=1)
