"""The edges and corners that CSG leaves: cut off by plain cells, and kept, from as many triangles."""

from collections.abc import Sequence

from blobtree import Mesh, Node, Point, Segment, polygonize, split_creases
from decals.scenes.scene import MeshObject, Scene

from .panels import Panel, main
from .stage import CLAY, looking

CELL = 0.17
"""Coarse cells, so that the difference is plain to see."""


def part() -> Node:
    """Make a turned block of six large balls with two bores."""
    far = 6.0
    block: Node = Point((far, 0, 0), radius=far + 1.0)
    for center in ((-far, 0, 0), (0, far, 0), (0, -far, 0), (0, 0, far), (0, 0, -far)):
        block = block & Point(center, radius=far + 1.0)
    bored = block - Segment((0, 0, -3), (0, 0, 3), radius=0.5) - Segment((-3, 0, 0), (3, 0, 0), radius=0.35)
    return bored.rotate((1, 2, 0), 20.0)


def panels() -> Sequence[Panel]:
    """Mesh the same part twice in the same cells."""
    tree = part()
    plain = polygonize(tree, cell_size=CELL)
    sharp = split_creases(tree, polygonize(tree, cell_size=CELL, creases=True))
    return _panel("plain", plain), _panel("creases", sharp)


def _panel(name: str, mesh: Mesh) -> Panel:
    item = MeshObject(name, mesh.vertices, mesh.faces, color=CLAY)
    return Panel(Scene(objects=(item,), camera=looking((5.2, -4.2, 3.4))))


if __name__ == "__main__":
    main(panels)
