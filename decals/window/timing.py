"""How long a stage's frames take."""

import time

from decals.vtk.stage import Stage
from decals.vtk.weak import weakly
from decals.window.quality import Quality


class Timing:
    """Tells a `Quality` of each frame that a stage drew, from its beginning to its end."""

    def __init__(self, stage: Stage, quality: Quality) -> None:
        self._stage, self._quality, self._began = stage, quality, 0.0
        renderer = stage.vtk_renderer
        self._tags = [
            renderer.AddObserver("StartEvent", weakly(self._begins)),
            renderer.AddObserver("EndEvent", weakly(self._ends)),
        ]

    def _begins(self) -> None:
        self._began = time.perf_counter()

    def _ends(self) -> None:
        if self._stage.drawn:
            size = self._stage.draw_scale * self._stage.samples
            self._quality.saw(size, time.perf_counter() - self._began, self._stage.drawn)

    def release(self) -> None:
        """Tell no more."""
        for tag in self._tags:
            self._stage.vtk_renderer.RemoveObserver(tag)
