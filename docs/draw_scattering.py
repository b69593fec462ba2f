"""Draw the picture of docs/scattering.md: particles, their radial spectrum and their distances.

``python docs/draw_scattering.py`` writes docs/images/scattering.png.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from blobtree._typing import Float64Array
from decals.scattering.neighbors import FacingTree, ideal_spacing
from decals.scattering.relaxation import Relaxation
from decals.surfaces.mesh import MeshSurface

COUNT = 6000
SIDE = 1.0
DRAWN_SIDE = 0.28
"""Side of the part that is drawn; spectra and distances leave out a margin at the boundary."""

PANEL, GAP, HEAD = 300, 24, 34
INK, BLUE, GREY = (30, 34, 40), (38, 98, 160), (190, 196, 204)
FREQUENCIES, TURNS = 120, 48
"""Rings of the spectrum up to four times the frequency of the spacing, and directions in each."""


def plane() -> MeshSurface:
    """Return a square in z = 0."""
    corners = [[0.0, 0.0, 0.0], [SIDE, 0.0, 0.0], [SIDE, SIDE, 0.0], [0.0, SIDE, 0.0]]
    return MeshSurface(corners, [[0, 1, 2], [0, 2, 3]])


def particles(steps: int) -> Float64Array:
    """Return relaxed particles on the square; 0 steps leave them at random."""
    relaxation = Relaxation([plane()], count=COUNT, iterations=max(steps, 1))
    if steps:
        relaxation.run()
    return relaxation.positions[:, :2].astype(np.float64)


def spectrum(points: Float64Array) -> Float64Array:
    """Return power over frequency, 0 to 4 / spacing, averaged over all directions; 1 is white noise."""
    window = np.prod(np.sin(np.pi * points / SIDE) ** 2, axis=1)
    frequencies = np.linspace(0.05, 4.0, FREQUENCIES) / ideal_spacing(SIDE**2, COUNT)
    turns = np.arange(TURNS) * (np.pi / TURNS)
    directions = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    power = [np.abs(np.exp(2j * np.pi * r * (points @ directions.T)).T @ window) ** 2 for r in frequencies]
    return np.mean(power, axis=1) / (window**2).sum()


def nearest(points: Float64Array) -> Float64Array:
    """Return the distance of each point to its nearest neighbour, in units of a perfect tiling's."""
    flat = np.pad(points, ((0, 0), (0, 1))).astype(np.float32)
    up = np.tile(np.float32([0, 0, 1]), (len(flat), 1))
    nearest_distances = FacingTree(flat, up).nearest(flat, up, skip_self=True)[0][:, 0]
    inner = (np.abs(points - 0.5 * SIDE) < 0.45 * SIDE).all(axis=1)
    distances: Float64Array = nearest_distances[inner] / ideal_spacing(SIDE**2, COUNT)
    return distances


def draw_points(draw: ImageDraw.ImageDraw, left: int, top: int, points: Float64Array) -> None:
    """Draw the middle of the square."""
    offsets = (points - 0.5 * (SIDE - DRAWN_SIDE)) / DRAWN_SIDE
    for x, y in offsets[((offsets > 0.01) & (offsets < 0.99)).all(axis=1)] * PANEL:
        draw.ellipse([left + x - 2.5, top + y - 2.5, left + x + 2.5, top + y + 2.5], fill=BLUE)


def draw_curve(draw: ImageDraw.ImageDraw, left: int, top: int, values: Float64Array, highest: float) -> None:
    """Draw values at even steps from left to right, cut off at the highest."""
    x = left + np.linspace(0, PANEL, len(values))
    y = top + PANEL * (1.0 - np.clip(values / highest, 0.0, 1.0))
    draw.line(
        [left, top + PANEL * (1 - 1 / highest), left + PANEL, top + PANEL * (1 - 1 / highest)], fill=GREY
    )
    draw.line(list(zip(x.tolist(), y.tolist(), strict=True)), fill=BLUE, width=2)


def draw_bars(draw: ImageDraw.ImageDraw, left: int, top: int, distances: Float64Array) -> None:
    """Draw a histogram from 0 to 1.25."""
    heights = np.histogram(distances, bins=60, range=(0.0, 1.25))[0]
    width = PANEL / len(heights)
    for column, height in enumerate(heights / heights.max() * (PANEL - 8)):
        x = left + column * width
        draw.rectangle([x, top + PANEL - height, x + width - 1, top + PANEL], fill=BLUE)


def main() -> None:
    """Draw three rows of three panels."""
    width, height = 3 * PANEL + 4 * GAP, 3 * (PANEL + HEAD) + GAP
    picture = Image.new("RGB", (width, height), "white")
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(15)
    for row, (name, steps) in enumerate((("random", 0), ("30 steps", 30), ("150 steps, the default", 150))):
        points = particles(steps)
        distances = nearest(points)
        top = row * (PANEL + HEAD) + HEAD
        titles = (
            name,
            "power over frequency, 0 to 4 / spacing",
            f"distance: least {distances.min():.2f}, CV {100 * distances.std() / distances.mean():.1f} %",
        )
        for column, title in enumerate(titles):
            left = GAP + column * (PANEL + GAP)
            draw.text((left, top - 22), title, fill=INK, font=font)
            draw.rectangle([left, top, left + PANEL, top + PANEL], outline=GREY)
        draw_points(draw, GAP, top, points)
        draw_curve(draw, 2 * GAP + PANEL, top, spectrum(points), 4.0)
        draw_bars(draw, 3 * GAP + 2 * PANEL, top, distances)
    picture.quantize(64).save(Path(__file__).parent / "images" / "scattering.png", optimize=True)


if __name__ == "__main__":
    main()
