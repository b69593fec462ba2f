"""Draw the picture of fitting in docs/modelling.md: 30 cones fitted to the scan of a horse.

``python docs/draw_fitting.py`` writes docs/images/fitting.png, in about a minute. The scan is pyvista's,
which downloads it at the first use.

The start comes from balls that touch the surface from inside. Those in the same neighbourhood become a cone
along their longest direction.
"""

from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image
from scipy.cluster.vq import kmeans2

from blobtree import Cone, Node, Ricci, fit
from decals.apps.models.samples import sample_mesh

CONES = 30
SAMPLES = 1500
EXPONENT = 4.0
LENGTH = 4.0
SIDE = 420
CLAY = "#c8c0b0"
VIEW = (-1.0, 0.35, 0.2)

Numbers = NDArray[np.float64]


def scan() -> pv.PolyData:
    """Return the mesh of the horse, LENGTH units long, with outward normals."""
    vertices, faces = sample_mesh("horse")
    moved = vertices - vertices.mean(axis=0)
    mesh = pv.PolyData.from_regular_faces(moved * (LENGTH / np.ptp(moved, axis=0).max()), faces)
    return mesh.compute_normals(auto_orient_normals=True, split_vertices=False)


def inner_balls(points: Numbers, normals: Numbers) -> tuple[Numbers, Numbers]:
    """Return centres and radii of the largest balls that touch each point from inside and hold no other."""
    offsets = points[:, None] - points
    heights = np.einsum("ijk,ik->ij", offsets, normals)
    with np.errstate(divide="ignore", invalid="ignore"):
        radii = np.where(heights > 1e-6, (offsets**2).sum(axis=2) / (2.0 * heights), np.inf).min(axis=1)
    kept = radii < 0.5 * LENGTH
    return (points - radii[:, None] * normals)[kept], radii[kept]


def start_from(points: Numbers, normals: Numbers) -> Node:
    """Return a blend of cones, one for each cluster of inner balls."""
    centers, radii = inner_balls(points, normals)
    _, clusters = kmeans2(centers, CONES, minit="++", rng=1)
    cones = []
    for cluster in range(CONES):
        members = centers[clusters == cluster]
        middle = members.mean(axis=0)
        _, spreads, axes = np.linalg.svd(members - middle, full_matrices=False)
        half = 1.2 * spreads[0] / np.sqrt(len(members)) * axes[0]
        radius = float(np.median(radii[clusters == cluster]))
        cones.append(Cone(tuple(middle - half), tuple(middle + half), radius=radius, end_radius=radius))
    return Ricci(tuple(cones), exponent=EXPONENT)


def draw(path: Path) -> None:
    """Fit the cones, print the distances and write the picture."""
    mesh = scan()
    chosen = np.random.default_rng(0).permutation(mesh.n_points)[:SAMPLES]
    points, normals = mesh.points[chosen].astype(np.float64), mesh.point_normals[chosen].astype(np.float64)
    start = start_from(points, normals)
    found = fit(start, points, normals=normals, max_evaluations=25)
    plotter = pv.Plotter(shape=(1, 3), off_screen=True, window_size=(3 * SIDE, SIDE), border=False)
    plotter.set_background("white")
    surfaces = [mesh, *(tree.to_pyvista(resolution=128) for tree in (start, found.tree))]
    for column, surface in enumerate(surfaces):
        _, closest = surface.find_closest_cell(points, return_closest_point=True)
        distances = np.linalg.norm(closest - points, axis=1)
        print(f"distance of the samples: {np.sqrt(np.mean(distances**2)) / LENGTH:.2%} of the length")
        plotter.subplot(0, column)
        plotter.add_mesh(surface, color=CLAY, smooth_shading=True)
        plotter.view_vector(VIEW, viewup=(0.0, 0.0, 1.0))
        plotter.camera.zoom(1.25)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    Image.fromarray(pixels).quantize(128).save(path, optimize=True)


if __name__ == "__main__":
    draw(Path(__file__).parent / "images" / "fitting.png")
