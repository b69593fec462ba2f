"""A stage in which a window edits: what it shows, and how, once the window is closed."""

from typing import TYPE_CHECKING

from decals.edit.document import Document
from decals.scenes.scene import Scene

if TYPE_CHECKING:
    from decals.vtk.stage import Stage


class Tenancy:
    """Remembers a stage as it is before a document is edited in it."""

    def __init__(self, stage: "Stage") -> None:
        self._stage, self._scene = stage, stage.scene
        self._settings = stage.samples, stage.draw_scale, stage.measure, stage.patient

    def end(self, document: Document) -> None:
        """Let the stage draw with its own settings again, and show what it did.

        In place of a scene that is the edited one. What somebody had it show since stays.
        """
        stage = self._stage
        stage.samples, stage.draw_scale, stage.measure, stage.patient = self._settings
        if stage.scene is document:
            stage.scene = document.scene if isinstance(self._scene, Scene) else self._scene


def edits_at(stage: "Stage", x: int, y: int) -> bool:
    """Whether some window edits in a stage that covers a place."""
    return isinstance(stage.scene, Document) and stage.covers(x, y)
