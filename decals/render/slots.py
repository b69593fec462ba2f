"""Targets by name: pictures of different slots do not overwrite each other."""

from collections.abc import Iterator

from decals.render.context import Context
from decals.render.targets import KINDS, Size, Targets

WHOLE_SLOT, BUFFERS_SLOT = "whole", "buffers"
"""Which targets pictures at once are drawn into, and pictures with what lies behind their pixels."""


class Slots:
    """The targets of a renderer, those of each slot for as long as its pictures have the same size."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._targets: dict[str, Targets] = {}

    def get(self, slot: str) -> Targets | None:
        """Give the targets of a slot's last picture, if there was one."""
        return self._targets.get(slot)

    def of(self, slot: str, size: Size) -> Targets:
        """Give targets of a size; those of the slot's last picture if they fit exactly."""
        targets = self._targets.get(slot)
        if targets is None or targets.gbuffer.size != size:
            if targets is not None:
                targets.release()
            targets = self._targets[slot] = Targets(self._context, size, buffers=slot == BUFFERS_SLOT)
        return targets

    def making(self, slot: str, size: Size) -> Iterator[Targets | None]:
        """Give targets of a size; before that, None after each piece of them: memory may come slowly."""
        held = self._targets.get(slot)
        if held is None or held.gbuffer.size != size:
            if held is not None:
                self._targets.pop(slot).release()
            self._context.clear_stock()
            for kind in KINDS:
                self._context.stock(size, kind)
                yield None
        yield self.of(slot, size)

    def forget(self) -> None:
        """Let the next pictures be drawn from the beginning."""
        for targets in self._targets.values():
            targets.shown = None

    def release(self) -> None:
        """Give the memory back."""
        for targets in self._targets.values():
            targets.release()
        self._targets.clear()
