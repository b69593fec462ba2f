"""Repeats of all kinds in flat and long boxes, whose tracing cells are finer than those of other trees."""

from blobtree import Box, EndlessRepeat, Node, Point, PolarRepeat, Repeat, Segment

_BRICK = Box((0.1, 0.0, 0.0), (0.6, 0.5, 0.4), radius=0)
_BAR = Segment((-0.1, 0.0, 0.0), (0.2, 0.1, 0.1), radius=0.15)
_PAIR = _BRICK | Point((0.1, 0.1, 0.3), radius=0.2)
_LATTICE = EndlessRepeat(Point((0, 0, 0), radius=0.12), (0.5, 0, 0)) & Box(
    (0, 0, 0), (1.4, 0.3, 0.3), radius=0
)


def _grid(child: Node, side: int, joining: str = "union", copies: str = "alike") -> Node:
    return Repeat(Repeat(child, (1, 0, 0), side, joining, copies), (0, 1, 0), side, joining, copies)


FLAT_TREES: dict[str, Node] = {
    "row": Repeat(_BRICK, (0, 1, 0), 200, "union"),
    "blended row": Repeat(_BAR, (0, 0, 0.7), 200),
    "mirrored row": Repeat(_BRICK, (0.9, 0.1, 0), 150, "union", "mirrored"),
    "grid": _grid(_BRICK, 18),
    "blended grid": _grid(Point((0, 0, 0), radius=0.45), 40, "sum"),
    "mirrored grid of unions": _grid(_PAIR, 14, "union", "mirrored"),
    "turned grid": _grid(_BAR, 24).rotate((0, 0, 1), 30),
    "ring": PolarRepeat(Box((16, 0, 0), (0.6, 0.5, 0.4), radius=0), (0, 0, 1), 100, "union"),
    "row of rings": Repeat(
        PolarRepeat(Segment((1, 0, 0), (1.3, 0, 0), radius=0.1), (0, 0, 1), 8), (3, 0, 0), 60
    ),
    "row of limited endless repeats": Repeat(_LATTICE, (0, 0.6, 0), 40, "union"),
}
