"""What the window shows besides the scene: outlines of what is selected, a line of text, and the help."""

import textwrap
from typing import Any

import numpy as np
import pyvista as pv

from decals.edit.document import Document
from decals.edit.keys import help_lines
from decals.edit.outlines import outline, rims
from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.surfaces.surface import Floats

MOST = 64
"""Of the selected decals that are outlined; the last one by what is seen of it, others by their rims."""

COLOR = (1.0, 0.75, 0.1)
WIDTH = 3
PAPER = 0.85
"""Opacity of what lies behind text."""


LINE, LETTER = 1.3, 0.62
"""Height of a line and width of a letter, in sizes of the font."""
LARGEST = 18
"""Size of the help's font, in pixels."""
MARGIN = 12
"""Pixels left free beside text."""
NARROWER = 0.9
"""Of the letters that fit into a line on average, so many do in one of wide letters."""
MOST_TALK = 0.3
"""Part of the height that what is said may take."""
CUT = " …"
"""Ends what is longer than that."""


class Marks:
    """Outlines, status and help in a plotter."""

    def __init__(self, plotter: pv.BasePlotter) -> None:
        self._plotter: Any = plotter
        self._renderer: Any = plotter.renderer
        self._lines = pv.PolyData()
        self._outlined: tuple[object, ...] = ()
        self._actor = plotter.add_mesh(
            pv.Line((0, 0, 0), (0, 0, 0)),
            color=COLOR,
            line_width=WIDTH,
            lighting=False,
            pickable=False,
            reset_camera=False,
            render=False,
            name="decals-selection",
        )
        self._actor.mapper.dataset = self._lines
        self._actor.use_bounds = False
        self._actor.ForceTranslucentOn()  # so that it leaves no depth: what it surrounds is not behind it
        self._said = ""
        self._status: Any = plotter.add_text(
            "", position=(MARGIN, 10), font_size=9, color="black", render=False, name="decals-status"
        )
        self._help: Any = plotter.add_text(
            "\n".join(help_lines()),
            position=(MARGIN, 40),
            font_size=8,
            color="black",
            font="courier",
            render=False,
            name="decals-help",
        )
        for text in (self._status, self._help):
            text.prop.SetBackgroundColor(1.0, 1.0, 1.0)
            text.prop.SetBackgroundOpacity(PAPER)
        self._help.SetVisibility(False)

    def outline(
        self, document: Document, numbers: tuple[int, ...], contact: Contact, mapping: Mapping
    ) -> None:
        """Outline decals; the last one exactly."""
        seen = (document.objects, document.decals.version, numbers, contact, mapping) if numbers else ()
        if seen == self._outlined:
            return
        self._outlined = seen
        chosen = numbers[-MOST:]
        lines = [outline(document, chosen[-1], contact=contact, mapping=mapping)] if chosen else []
        lines += list(rims(document, np.array(chosen[:-1], np.int64), mapping=mapping))
        self._lines.copy_from(_polylines(lines))
        self._actor.SetVisibility(bool(lines))

    def say(self, text: str) -> None:
        """Show text at the bottom, in several lines where one is too long."""
        self._said = text
        self._status.SetInput(text)
        size = [0.0, 0.0]
        self._status.GetSize(self._renderer, size)
        width, height = self._renderer.GetSize()
        room = width - 2 * MARGIN
        if size[0] > room > 0:
            letters = max(int(len(text) * room / size[0] * NARROWER), len(CUT))
            most = max(int(height * MOST_TALK / size[1]), 1)
            self._status.SetInput("\n".join(textwrap.wrap(text, letters, max_lines=most, placeholder=CUT)))

    def show_help(self, shown: bool) -> None:
        """Show the help, as large as the window allows, or hide it."""
        self._help.SetVisibility(shown)
        if not shown:
            return
        width, height = self._renderer.GetSize()
        lines = help_lines()
        tall = (height - 60) / (LINE * len(lines))
        wide = (width - 2 * MARGIN) / (LETTER * max(map(len, lines)))
        self._help.prop.SetFontSize(max(6, min(LARGEST, int(min(tall, wide)))))

    def release(self) -> None:
        """Take everything out of the plotter."""
        for actor in (self._actor, self._status, self._help):
            self._plotter.remove_actor(actor, render=False)

    @property
    def status(self) -> str:
        """What is said at the bottom."""
        return self._said

    @property
    def help_shown(self) -> bool:
        """Whether the help is to be seen."""
        return bool(self._help.GetVisibility())

    @property
    def lines(self) -> pv.PolyData:
        """The outlines, as they are drawn."""
        return self._lines


def _polylines(lines: list[Floats]) -> pv.PolyData:
    if not lines:
        return pv.PolyData()
    counts = [len(line) for line in lines]
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    cells = [np.concatenate([[n], start + np.arange(n)]) for n, start in zip(counts, starts, strict=True)]
    return pv.PolyData(np.concatenate(lines), lines=np.concatenate(cells))
