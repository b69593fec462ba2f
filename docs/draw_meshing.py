"""Draw the picture of docs/meshing.md: triangles without and with creases, and a slice.

``python docs/draw_meshing.py`` writes docs/images/meshing.png.
"""

from pathlib import Path

import pyvista as pv
from PIL import Image

from blobtree import Point

SIDE = 420
CLAY, INK = "#c8c0b0", "#1e2228"
VIEW = [(2.6, -3.2, 1.9), (0.1, 0.0, 0.0), (0.0, 0.0, 1.0)]


def draw(path: Path) -> None:
    """Write the picture."""
    ball = Point((0, 0, 0), radius=1.0)
    cut = (ball & Point((0.5, 0, 0), radius=0.9)) - Point((0.3, -0.9, 0.3), radius=0.6)
    blend = ball + Point((1.1, 0.2, 0), radius=0.6) - Point((0.2, 0.9, 0), radius=0.5)
    plotter = pv.Plotter(shape=(1, 3), off_screen=True, window_size=(3 * SIDE, SIDE), border=False)
    plotter.set_background("white")
    for column, creases in enumerate((False, True)):
        plotter.subplot(0, column)
        mesh = cut.to_pyvista(resolution=36, split_normals=creases)
        plotter.add_mesh(mesh, color=CLAY, show_edges=True, edge_color=INK, line_width=1)
        plotter.camera_position = VIEW
    plotter.subplot(0, 2)
    field = blend.slice()
    plotter.add_mesh(field["plane"], scalars="field", cmap="viridis", show_scalar_bar=False, lighting=False)
    plotter.add_mesh(field["lines"], color="white", line_width=1)
    plotter.add_mesh(field["surface"], color=INK, line_width=4)
    plotter.view_xy()
    plotter.camera.zoom(1.5)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    Image.fromarray(pixels).quantize(128).save(path, optimize=True)


if __name__ == "__main__":
    draw(Path(__file__).parent / "images" / "meshing.png")
