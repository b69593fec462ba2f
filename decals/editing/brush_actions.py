"""Actions that choose the brush of a window."""

from collections.abc import Callable

from blobtree._typing import Int64Array
from decals.editing.action_state import WindowActions
from decals.editing.brush_settings import Brush
from decals.editing.brushes import BrushStroke
from decals.editing.key_bindings import Group

BRUSHES = {
    Brush.SELECT: ("w", "select and move decals"),
    Brush.ADD: ("Shift+s", "add decals: click to add one"),
    Brush.BOX: ("b", "box: drag to select decals"),
    Brush.LASSO: ("Shift+b", "lasso: drag around decals to select them"),
    Brush.PAINT: ("Shift+w", "paint: drag over decals to select them"),
    Brush.PULL: ("z", "pull: drag the surface, and the selected node follows"),
    Brush.SCATTER: ("s", "scatter brush: drag to place decals"),
    Brush.PUSH: ("y", "push brush: drag to push decals; neighbours make room"),
    Brush.ERASE: ("e", "erase brush: drag to delete decals"),
    Brush.RELAX: ("Shift+x", "relax brush: drag to even decals out"),
    Brush.ALIGN: ("Shift+a", "align brush: drag to turn images along the stroke"),
}
"""Key of each brush, and what it does."""


class BrushActions(WindowActions):
    """Actions that choose the brush: one per entry of `BRUSHES`, "brush_select" and so on."""

    def choose(self, brush: Brush) -> None:
        """Drag with a brush from now on."""
        self._state.brush.brush, self._state.message = brush, BRUSHES[brush][1]

    def stroke(self, select: Callable[[Int64Array], None]) -> BrushStroke:
        """Return a stroke of the chosen brush; `select` takes the decals that the paint brush touches."""
        state = self._state
        return BrushStroke(lambda: state.session.document, state.brush, state.run_latest, select)


for _brush, (_key, _summary) in BRUSHES.items():
    _register = Group.BRUSHES.action(f"brush_{_brush}", _key, summary=_summary)
    setattr(
        BrushActions, f"choose_{_brush}", _register(lambda actions, _, brush=_brush: actions.choose(brush))
    )
