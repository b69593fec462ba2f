"""Draw the picture of docs/seeding.md: seeds, their radial spectrum and their distances.

``python docs/draw_seeding.py`` writes docs/images/seeding.png.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from decals.seeds.evenness import ideal_spacing
from decals.seeds.neighbours import FacingTree
from decals.seeds.relaxation import Relaxation
from decals.surfaces.mesh import MeshSurface

COUNT = 6000
SIDE = 1.0
SEEN = 0.28
"""Side of the part that is drawn; spectra and distances leave out a margin at the rim."""

PANEL, GAP, HEAD = 300, 24, 34
INK, BLUE, GREY = (30, 34, 40), (38, 98, 160), (190, 196, 204)
FREQUENCIES, TURNS = 120, 48
"""Rings of the spectrum up to four times the frequency of the spacing, and directions in each."""

Floats = NDArray[np.float64]


def plane() -> MeshSurface:
    """Make a square in z = 0."""
    corners = [[0.0, 0.0, 0.0], [SIDE, 0.0, 0.0], [SIDE, SIDE, 0.0], [0.0, SIDE, 0.0]]
    return MeshSurface(corners, [[0, 1, 2], [0, 2, 3]])


def seeds(steps: int) -> Floats:
    """Spread seeds over the square; 0 steps leave them at random."""
    relaxation = Relaxation([plane()], count=COUNT, iterations=max(steps, 1))
    if steps:
        relaxation.run()
    return relaxation.positions[:, :2].astype(np.float64)


def spectrum(points: Floats) -> Floats:
    """Power over frequency, 0 to 4 over the spacing, averaged over all directions; 1 is white noise."""
    window = np.prod(np.sin(np.pi * points / SIDE) ** 2, axis=1)
    rings = np.linspace(0.05, 4.0, FREQUENCIES) / ideal_spacing(SIDE**2, COUNT)
    turns = np.arange(TURNS) * (np.pi / TURNS)
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    power = [np.abs(np.exp(2j * np.pi * r * (points @ ways.T)).T @ window) ** 2 for r in rings]
    return np.mean(power, axis=1) / (window**2).sum()


def nearest(points: Floats) -> Floats:
    """Distance of each point to its nearest neighbour, in units of a perfect tiling's."""
    flat = np.pad(points, ((0, 0), (0, 1))).astype(np.float32)
    up = np.tile(np.float32([0, 0, 1]), (len(flat), 1))
    found = FacingTree(flat, up).nearest(flat, up, skip_self=True)[0][:, 0]
    inner = (np.abs(points - 0.5 * SIDE) < 0.45 * SIDE).all(axis=1)
    distances: Floats = found[inner] / ideal_spacing(SIDE**2, COUNT)
    return distances


def draw_points(draw: ImageDraw.ImageDraw, left: int, top: int, points: Floats) -> None:
    """Draw the middle of the square."""
    places = (points - 0.5 * (SIDE - SEEN)) / SEEN
    for x, y in places[((places > 0.01) & (places < 0.99)).all(axis=1)] * PANEL:
        draw.ellipse([left + x - 2.5, top + y - 2.5, left + x + 2.5, top + y + 2.5], fill=BLUE)


def draw_curve(draw: ImageDraw.ImageDraw, left: int, top: int, values: Floats, highest: float) -> None:
    """Draw values at even steps from left to right, cut off at the highest."""
    x = left + np.linspace(0, PANEL, len(values))
    y = top + PANEL * (1.0 - np.clip(values / highest, 0.0, 1.0))
    draw.line(
        [left, top + PANEL * (1 - 1 / highest), left + PANEL, top + PANEL * (1 - 1 / highest)], fill=GREY
    )
    draw.line(list(zip(x.tolist(), y.tolist(), strict=True)), fill=BLUE, width=2)


def draw_bars(draw: ImageDraw.ImageDraw, left: int, top: int, distances: Floats) -> None:
    """Draw a histogram from 0 to 1.25."""
    heights = np.histogram(distances, bins=60, range=(0.0, 1.25))[0]
    width = PANEL / len(heights)
    for place, height in enumerate(heights / heights.max() * (PANEL - 8)):
        x = left + place * width
        draw.rectangle([x, top + PANEL - height, x + width - 1, top + PANEL], fill=BLUE)


def main() -> None:
    """Draw three rows of three panels."""
    width, height = 3 * PANEL + 4 * GAP, 3 * (PANEL + HEAD) + GAP
    picture = Image.new("RGB", (width, height), "white")
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(15)
    for row, (name, steps) in enumerate((("random", 0), ("30 steps", 30), ("150 steps, the default", 150))):
        points = seeds(steps)
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
    picture.quantize(64).save(Path(__file__).parent / "images" / "seeding.png", optimize=True)


if __name__ == "__main__":
    main()
