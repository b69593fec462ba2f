"""Draw the picture of sharp edges on docs/modelling.md: solids, and the edges of their meshes.

``python docs/draw_sharp.py`` writes docs/images/sharp.png.
"""

from pictures import DOCS, draw_row

from blobtree import Box, Cylinder, Frustum, Prism

CLAY, INK = "#c8c0b0", "#1e2228"
VIEW = [(2.6, -3.4, 2.2), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
BLOCK = Box((0, 0, 0), (2, 1, 1), radius=0)
HOLE = Cylinder((0, 0, -1), (0, 0, 1), 0.3, radius=0)
STAR = [(0, 1, -0.4), (-0.3, 0.2, -0.4), (-1, 0, -0.4), (-0.3, -0.2, -0.4)]
STAR += [(-x, -y, z) for x, y, z in STAR]
SOLIDS = (BLOCK - HOLE, Prism(STAR, 0.8), Frustum((0, 0, -0.8), (0, 0, 0.8), 0.9, 0.4), BLOCK.offset(0.15))


if __name__ == "__main__":
    surfaces = [solid.to_pyvista(resolution=24, split_normals=True) for solid in SOLIDS]
    edges = {"color": CLAY, "show_edges": True, "edge_color": INK, "line_width": 1}
    draw_row(DOCS / "images" / "sharp.png", surfaces, [edges] * len(SOLIDS), VIEW)
