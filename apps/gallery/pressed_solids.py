"""Contact between solids
======================

Solids that deform each other. Two of equal stiffness, and a soft one on a stiff one. Then three, and the same
three apart, which shows the surfaces that they share.
"""

from collections.abc import Sequence

from blobtree import Ellipsoid, Node, Point, Segment, SolidContact
from decals import Scene, TreeObject
from decals.apps.gallery.helpers import Panel, camera_at, main

CORAL, SAND, TEAL = (0.86, 0.45, 0.36), (0.88, 0.75, 0.50), (0.30, 0.58, 0.60)
CAMERA = camera_at((1.8, -6.3, 2.5), target=(0.1, 0.0, 0.05))


def stacked(stiffness: tuple[float, float]) -> SolidContact:
    """Return a ball that is pressed onto a larger one."""
    upper = Point((0.0, 0.0, 0.55), radius=0.75, color=CORAL)
    lower = Ellipsoid((0.0, 0.0, -0.5), (1.1, 1.1, 0.7), color=TEAL)
    return SolidContact((upper, lower), stiffness=stiffness, width=0.4, height=0.08)


def trio() -> SolidContact:
    """Return three blobs pressed into one another."""
    bean = Segment((-0.55, -0.1, -0.35), (-0.45, 0.2, 0.4), radius=0.62, color=CORAL)
    ball = Point((0.55, 0.0, 0.45), radius=0.72, color=SAND)
    pebble = Ellipsoid((0.45, -0.1, -0.5), (0.95, 0.75, 0.6), color=TEAL)
    return SolidContact((bean, ball, pebble), width=0.4, height=0.07)


def panels() -> Sequence[Panel]:
    """Draw two pairs, three solids in contact, and the same solids apart."""
    bean, ball, pebble = trio().solids()
    apart = (bean.translate((-0.25, 0, 0)), ball.translate((0.2, 0, 0.25)), pebble.translate((0.2, 0, -0.2)))
    return (
        _panel(stacked((1.0, 1.0))),
        _panel(stacked((1.0, 8.0))),
        _panel(trio()),
        _panel(*apart),
    )


def _panel(*trees: Node) -> Panel:
    objects = tuple(TreeObject(f"solid {number}", tree) for number, tree in enumerate(trees))
    return Panel(Scene(objects=objects, camera=CAMERA))


if __name__ == "__main__":
    main(panels)
