"""The actors of VTK's own that a stage's decals lie on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from decals.vtk.injection import Injection

if TYPE_CHECKING:
    from decals.vtk.stage import Stage

INJECTED_TEXTURES = 5
"""Images, records and the three arrays of the index."""


class Applied:
    """Injections of one stage, and the texture units that they share.

    Parameters
    ----------
    stage
        Whose decals.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._injections: list[Injection] = []
        self._units: list[int] = []

    def apply(self, actor: Any, *, follow: bool) -> None:
        """Put the decals into VTK's own shader of an actor."""
        self.remove(actor)
        self._injections.append(Injection(self._stage, actor, follow=follow))

    def remove(self, actor: Any) -> None:
        """Take the decals off an actor; nothing happens if it had none."""
        self._drop([item for item in self._injections if item.actor is actor])

    def clear(self) -> None:
        """Take the decals off all actors."""
        self._drop(self._injections)

    def _drop(self, injections: list[Injection]) -> None:
        if not injections:
            return
        with self._stage.current_if_there():
            for injection in injections:
                injection.release()
        self._injections = [item for item in self._injections if item not in injections]

    def texture_units(self) -> list[int]:
        """Texture units that are ours until the end of this frame, as many as an injected shader reads."""
        if not self._units:
            self._units = [self._manager.Allocate() for _ in range(INJECTED_TEXTURES)]
        return self._units

    @property
    def _manager(self) -> Any:
        return self._stage.vtk_renderer.GetRenderWindow().GetTextureUnitManager()

    def prepare(self) -> None:
        """Bring meshes and shaders up to date, before VTK draws a frame."""
        if self._injections:
            with self._stage.current():
                for injection in self._injections:
                    injection.prepare()

    def finish(self) -> None:
        """Give back what is held for one frame."""
        for unit in self._units:
            self._manager.Free(unit)
        self._units = []
        for injection in self._injections:
            injection.finish()
