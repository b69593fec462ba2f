"""What the scripts that draw the pictures of pages share: a page's code, and pictures of trees."""

import re
import runpy
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from PIL import Image

from blobtree import Node

DOCS = Path(__file__).parent
DIRECTION = (0.8, -1.0, 0.7)
"""From the model to the camera."""

MARGIN = 1.08
"""Size of a picture over that of its largest model."""


def code_of(page: Path) -> str:
    """Return the Python blocks of a page as one script."""
    return "\n".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL))


def run_code(text: str) -> dict[str, Any]:
    """Return the names that a script defines; it runs from a file, as custom nodes need their source."""
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "script.py"
        script.write_text(text, encoding="utf-8")
        return runpy.run_path(str(script))


def draw_row(
    path: Path, surfaces: Sequence[pv.PolyData], options: Sequence[dict[str, Any]], view: Any, side: int = 320
) -> None:
    """Write a PNG picture of surfaces side by side, each with its options of `add_mesh`, from one view."""
    size = len(surfaces) * side, side
    plotter = pv.Plotter(shape=(1, len(surfaces)), off_screen=True, window_size=size, border=False)
    plotter.set_background("white")
    for column, (surface, looks) in enumerate(zip(surfaces, options, strict=True)):
        plotter.subplot(0, column)
        plotter.add_mesh(surface, **looks)
        plotter.camera_position = view
        plotter.camera.zoom(0.9)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    Image.fromarray(pixels).quantize(128).save(path, optimize=True)


def draw_trees(
    path: Path,
    trees: Sequence[Node],
    size: tuple[int, int],
    *,
    direction: Sequence[float] = DIRECTION,
    resolution: int = 64,
    lines: bool = False,
    quality: int = 80,
) -> None:
    """Write a picture of trees side by side, all at the same scale.

    Parameters
    ----------
    path
        JPEG file to write.
    trees
        One to three trees.
    size
        Width and height of each one's part of the picture, in pixels.
    direction
        From the models to the camera.
    resolution
        That of the meshes.
    lines
        Add a part with level lines of the last tree's field in the plane z = 0.
    quality
        That of the JPEG file, up to 100.
    """
    width, height = size
    toward = np.asarray(direction, float) / np.linalg.norm(direction)
    right = np.cross((0.0, 1.0, 0.0) if abs(toward[2]) > 0.99 else (0.0, 0.0, 1.0), toward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(toward, right), toward])
    surfaces = [tree.to_pyvista(resolution=resolution, split_normals=True) for tree in trees]
    seen = [surface.points @ axes.T for surface in surfaces]
    half = np.max([0.5 * np.ptp(points, axis=0) for points in seen], axis=0)
    parts = len(trees) + lines
    plotter = pv.Plotter(
        shape=(1, parts), off_screen=True, window_size=(2 * width * parts, 2 * height), border=False
    )
    plotter.set_background("white")
    for column, (surface, points) in enumerate(zip(surfaces, seen, strict=True)):
        plotter.subplot(0, column)
        plotter.add_mesh(surface, scalars="RGB", rgb=True, smooth_shading=False, specular=0.2)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0)) @ axes
        plotter.camera_position = [tuple(middle + 10.0 * half.max() * toward), tuple(middle), tuple(axes[1])]
        plotter.enable_parallel_projection()
        plotter.camera.parallel_scale = MARGIN * max(half[1], half[0] * height / width)
    if lines:
        plotter.subplot(0, parts - 1)
        field = trees[-1].slice()
        plotter.add_mesh(
            field["plane"], scalars="field", cmap="viridis", show_scalar_bar=False, lighting=False
        )
        plotter.add_mesh(field["lines"], color="white", line_width=2)
        plotter.add_mesh(field["surface"], color="black", line_width=5)
        low_x, high_x, low_y, high_y, *_ = field["plane"].bounds
        plotter.view_xy()
        plotter.enable_parallel_projection()
        plotter.camera.parallel_scale = 0.5 * max(high_y - low_y, (high_x - low_x) * height / width)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    small = Image.fromarray(pixels).resize((width * parts, height), Image.Resampling.LANCZOS)
    path.parent.mkdir(parents=True, exist_ok=True)
    small.save(path, quality=quality, optimize=True)
