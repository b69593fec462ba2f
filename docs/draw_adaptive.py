"""Draw the picture of adaptive cells in docs/meshing.md: one chord error in cells of one size, and adaptive.

``python docs/draw_adaptive.py`` writes docs/images/adaptive.png.
"""

from pathlib import Path

import pyvista as pv
from PIL import Image

from blobtree import Point

SIDE = 520
CLAY, INK = "#c8c0b0", "#1e2228"
VIEW = [(3.2, -3.0, 2.0), (0.35, 0.0, 0.0), (0.0, 0.0, 1.0)]
CHORD_ERROR = 0.02


def draw(path: Path) -> None:
    """Write the picture."""
    model = (
        Point((0, 0, 0), radius=1.0)
        + Point((1.1, 0, 0.1), radius=0.25)
        + Point((0.6, -0.9, 0.4), radius=0.12)
    )
    plotter = pv.Plotter(shape=(1, 2), off_screen=True, window_size=(2 * SIDE, SIDE), border=False)
    plotter.set_background("white")
    for column, adaptive in enumerate((False, True)):
        plotter.subplot(0, column)
        mesh = model.to_pyvista(chord_error=CHORD_ERROR, adaptive=adaptive)
        plotter.add_mesh(mesh, color=CLAY, show_edges=True, edge_color=INK, line_width=1)
        plotter.camera_position = VIEW
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    Image.fromarray(pixels).quantize(64).save(path, optimize=True)


if __name__ == "__main__":
    draw(Path(__file__).parent / "images" / "adaptive.png")
