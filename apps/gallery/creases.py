"""Creases
=======

The edges and corners that CSG leaves, at equal resolution: cut off by default, and kept by
``creases=True``.
"""

from collections.abc import Sequence

from blobtree import Mesh, Node, Point, Segment, polygonize, split_creases
from decals import MeshObject, Scene
from decals.apps.gallery.helpers import CLAY, Panel, camera_at, main

CELL_SIZE = 0.17
"""Side of a cell: coarse, so that the difference is visible."""


def part() -> Node:
    """Intersect six large balls, subtract two bores, and rotate the result."""
    d = 6.0
    block: Node = Point((d, 0, 0), radius=d + 1.0)
    for center in ((-d, 0, 0), (0, d, 0), (0, -d, 0), (0, 0, d), (0, 0, -d)):
        block = block & Point(center, radius=d + 1.0)
    bored = block - Segment((0, 0, -3), (0, 0, 3), radius=0.5) - Segment((-3, 0, 0), (3, 0, 0), radius=0.35)
    return bored.rotate((1, 2, 0), 20.0)


def panels() -> Sequence[Panel]:
    """Polygonize the same part with the same cells, without and with creases."""
    tree = part()
    smooth = polygonize(tree, cell_size=CELL_SIZE)
    sharp = split_creases(tree, polygonize(tree, cell_size=CELL_SIZE, creases=True))
    return _panel("plain", smooth), _panel("creases", sharp)


def _panel(name: str, mesh: Mesh) -> Panel:
    smooth_angle = 180.0  # edges show only where the mesh itself has several vertices
    item = MeshObject(name, mesh.vertices, mesh.faces, color=CLAY, crease_angle=smooth_angle)
    return Panel(Scene(objects=(item,), camera=camera_at((5.2, -4.2, 3.4))))


if __name__ == "__main__":
    main(panels)
