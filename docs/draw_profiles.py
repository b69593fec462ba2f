"""Draw the picture of profiles on docs/modelling.md: outlines that are extended, tapered, turned and rounded.

``python docs/draw_profiles.py`` writes docs/images/profiles.png.
"""

from pathlib import Path

import pyvista as pv
from PIL import Image

from blobtree import Extrude, Outline, Revolve

SIDE = 320
COLORS = ("#c8553d", "#4d9078", "#e0a030", "#5b6c8f")
VIEW = [(1.6, -3.4, 2.6), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
LOGO = Outline.arcs([(-1, 0), (1, 0)], 1) + Outline.text("&", size=1.8).translate((-0.7, -0.65))
SQUARE = Outline.arcs([(-0.6, -0.6), (0.6, -0.6), (0.6, 0.6), (-0.6, 0.6)], -0.2)
VASE = "M0-1H.5C.5-.6 1-.4 1 .2S.4.6.6 1H.5C.3.6.9.5.9.2S.4-.9 0-.9Z"
SOLIDS = (
    Extrude(LOGO, 0.4, origin=(0, 0, -0.2)),
    Extrude(SQUARE, 1.6, top_scale=0.6, top_turn=90, origin=(0, 0, -0.8)),
    Revolve(VASE, 250).rotate((0, 0, 1), -20),
    Extrude(Outline.text("ab", size=1.8).translate((-1.1, -0.6)), 0.3, radius=0.06, origin=(0, 0, -0.15)),
)


def draw(path: Path) -> None:
    """Write the picture."""
    plotter = pv.Plotter(
        shape=(1, len(SOLIDS)), off_screen=True, window_size=(len(SOLIDS) * SIDE, SIDE), border=False
    )
    plotter.set_background("white")
    for column, (solid, color) in enumerate(zip(SOLIDS, COLORS, strict=True)):
        plotter.subplot(0, column)
        plotter.add_mesh(solid.to_pyvista(resolution=150, split_normals=True), color=color)
        plotter.camera_position = VIEW
        plotter.camera.zoom(0.9)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    Image.fromarray(pixels).quantize(128).save(path, optimize=True)


if __name__ == "__main__":
    draw(Path(__file__).parent / "images" / "profiles.png")
