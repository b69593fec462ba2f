"""Draw the picture of profiles on docs/modelling.md: outlines that are drawn, turned, swept and rounded.

``python docs/draw_profiles.py`` writes docs/images/profiles.png.
"""

from pictures import DOCS, draw_row

from blobtree import Extrude, Outline, Revolve, Sweep

COLORS = ("#c8553d", "#4d9078", "#e0a030", "#5b6c8f", "#8f5b7a")
VIEW = [(1.6, -3.4, 2.6), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
LOGO = Outline.arcs([(-1, 0), (1, 0)], 1) + Outline.text("&", size=1.8).translate((-0.7, -0.65))
SQUARE = Outline.arcs([(-0.6, -0.6), (0.6, -0.6), (0.6, 0.6), (-0.6, 0.6)], -0.2)
VASE = "M0-1H.5C.5-.6 1-.4 1 .2S.4.6.6 1H.5C.3.6.9.5.9.2S.4-.9 0-.9Z"
FRAME = "M-.18-.12H.18L.1.02 .06.02 .02.12H-.18Z"
CORNERS = [(-0.8, -0.6, 0.0), (0.8, -0.6, 0.0), (0.8, 0.6, 0.0), (-0.8, 0.6, 0.0)]
SOLIDS = (
    Extrude(LOGO, 0.4, origin=(0, 0, -0.2)),
    Extrude(SQUARE, 1.6, top_scale=0.6, top_turn=90, origin=(0, 0, -0.8)),
    Revolve(VASE, 250).rotate((0, 0, 1), -20),
    Sweep(FRAME, CORNERS, ends="closed"),
    Extrude(Outline.text("ab", size=1.8).translate((-1.1, -0.6)), 0.3, radius=0.06, origin=(0, 0, -0.15)),
)


if __name__ == "__main__":
    surfaces = [solid.to_pyvista(resolution=150, split_normals=True) for solid in SOLIDS]
    draw_row(DOCS / "images" / "profiles.png", surfaces, [{"color": color} for color in COLORS], VIEW)
