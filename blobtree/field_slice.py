"""The field of a tree on a plane, as pyvista blocks; the module is imported only when pyvista is needed."""

from typing import Any

import numpy as np
import pyvista as pv

from blobtree.graphics import opens_window

LINE_COLORS = {"lines": (255, 255, 255), "surface": (30, 34, 40)}
"""Colours of the iso-lines in a plot, uint8."""

COLOR_ARRAY = "line_rgb"
"""Name of the point data with these colours; pyvista takes the ending for colours."""

LINE_WIDTH = 2

LIFT = 0.003
"""Distance of the lines from the plane in a plot, relative to its diagonal: else they would flicker."""


class FieldSlice(pv.MultiBlock):
    """Blocks "plane", "lines" and "surface" with point data "field"; see `Node.slice`."""

    def plot(self, **options: Any) -> Any:  # type: ignore[override]  # all arguments by name
        """Show the plane coloured by its field, with white iso-lines and the surface dark.

        pyvista would draw the lines in the colours of their field values, which are those of the plane.

        Parameters
        ----------
        options
            Arguments of `pyvista.plot`, such as ``cmap`` and ``screenshot``.

        Returns
        -------
        object
            Result of `pyvista.plot`.

        Raises
        ------
        NoGraphics
            There is no screen for the window.
        """
        blocks: dict[str, Any] = dict(zip(self.keys(), self, strict=True))
        plane = blocks["plane"]
        lift = LIFT * plane.length * plane.face_normals[0]
        shown = [plane]
        for name, color in LINE_COLORS.items():
            if blocks[name].n_points:  # pyvista refuses empty meshes
                colors = np.tile(np.array(color, np.uint8), (blocks[name].n_points, 1))
                for offset in (lift, -lift):
                    lines = blocks[name].translate(offset)
                    lines.point_data[COLOR_ARRAY] = colors
                    lines.set_active_scalars(COLOR_ARRAY)
                    shown.append(lines)
        opens_window(options)
        return pv.plot(shown, **{"lighting": False, "line_width": LINE_WIDTH, **options})
