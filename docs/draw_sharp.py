"""Draw the picture of sharp edges on docs/modelling.md: solids, and the edges of their meshes.

``python docs/draw_sharp.py`` writes docs/images/sharp.png.
"""

from pathlib import Path

import pyvista as pv
from PIL import Image

from blobtree import Box, Cylinder, Frustum, Prism

SIDE = 320
CLAY, INK = "#c8c0b0", "#1e2228"
VIEW = [(2.6, -3.4, 2.2), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
BLOCK = Box((0, 0, 0), (2, 1, 1), radius=0)
HOLE = Cylinder((0, 0, -1), (0, 0, 1), 0.3, radius=0)
STAR = [(0, 1, -0.4), (-0.3, 0.2, -0.4), (-1, 0, -0.4), (-0.3, -0.2, -0.4)]
STAR += [(-x, -y, z) for x, y, z in STAR]
SOLIDS = (BLOCK - HOLE, Prism(STAR, 0.8), Frustum((0, 0, -0.8), (0, 0, 0.8), 0.9, 0.4), BLOCK.offset(0.15))


def draw(path: Path) -> None:
    """Write the picture."""
    size = len(SOLIDS) * SIDE, SIDE
    plotter = pv.Plotter(shape=(1, len(SOLIDS)), off_screen=True, window_size=size, border=False)
    plotter.set_background("white")
    for column, solid in enumerate(SOLIDS):
        plotter.subplot(0, column)
        mesh = solid.to_pyvista(resolution=24, split_normals=True)
        plotter.add_mesh(mesh, color=CLAY, show_edges=True, edge_color=INK, line_width=1)
        plotter.camera_position = VIEW
        plotter.camera.zoom(0.9)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    Image.fromarray(pixels).quantize(128).save(path, optimize=True)


if __name__ == "__main__":
    draw(Path(__file__).parent / "images" / "sharp.png")
