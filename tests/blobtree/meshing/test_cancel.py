"""Long work reports often, and a cancelled update keeps the last mesh."""

import numpy as np
import pytest

from blobtree import Node, Point, Polygonizer, polygonize
from blobtree.errors import Cancelled

TREE: Node = Point((0, 0, 0), radius=1.0) - Point((0.8, 0, 0), radius=0.8)


class CancelAfter:
    """A `cancel` that returns True after `limit` calls."""

    def __init__(self, limit: float) -> None:
        self.limit, self.asked = limit, 0

    def __call__(self) -> bool:
        self.asked += 1
        return self.asked > self.limit


@pytest.mark.parametrize("creases", [False, True], ids=["plain", "creases"])
def test_cancel_stops_at_any_report(creases: bool) -> None:
    endless = CancelAfter(np.inf)
    polygonize(TREE, resolution=150, creases=creases, cancel=endless)
    assert endless.asked > 100
    for limit in (0, 1, endless.asked // 2, endless.asked - 1):
        cancel = CancelAfter(limit)
        with pytest.raises(Cancelled, match=r"^cancelled while "):
            polygonize(TREE, resolution=150, creases=creases, cancel=cancel)
        assert cancel.asked == limit + 1


def test_cancel_stops_passes_by_chord_error() -> None:
    stages: list[str] = []
    with pytest.raises(Cancelled, match="pass 2"):
        polygonize(
            TREE,
            chord_error=1e-3,
            creases=True,
            progress=lambda stage, _fraction: stages.append(stage),
            cancel=lambda: stages[-1:] == ["meshing, pass 2"],
        )


def test_a_cancelled_update_keeps_the_last_mesh() -> None:
    polygonizer = Polygonizer(TREE, resolution=48)
    before = polygonizer.mesh
    edited = TREE.translate((0.3, 0, 0))
    with pytest.raises(Cancelled):
        polygonizer.update(edited, cancel=lambda: True)
    assert polygonizer.tree is TREE
    assert polygonizer.mesh is before
    after = polygonizer.update(edited)
    fresh = polygonize(edited, cell_size=polygonizer.cell_size)
    np.testing.assert_array_equal(after.vertices, fresh.vertices)
    np.testing.assert_array_equal(after.faces, fresh.faces)
