"""Draw the picture of rounded operators on docs/modelling.md: sections, and where arcs begin.

``python docs/draw_widths.py`` writes docs/images/widths.png. The bar and the ball have very different fields.
Dots mark where surfaces leave the sharp ones, and texts state measured distances from the other surface.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from blobtree import Box, Node, Point, RoundDifference, RoundIntersection, RoundUnion

SIDE, SCALE = 360, 2
SPAN = 3.2
WIDTH = 0.4
EXACT, DEPARTED = 1e-5, 2e-6
BALL = Point((0, 0.5, 0), radius=1.0, falloff="cauchy")
BAR = Box((0, -0.5, 0), (3.0, 1.0, 3.0), radius=0, width=0.8)
ROUNDED = (
    RoundUnion(BALL, BAR, WIDTH),
    RoundIntersection(BALL, BAR, WIDTH),
    RoundDifference(BAR, BALL, WIDTH),
)
SHARP = (BALL | BAR, BALL & BAR, BAR - BALL)
CLAY, INK, MARK = (200, 192, 176), (30, 34, 40), (200, 60, 40)

Points = NDArray[np.float64]


def pixel(point: Points) -> tuple[float, float]:
    """Return the place of a point in a picture."""
    x, y = (SIDE * SCALE * (0.5 + point[:2] / SPAN)).tolist()
    return x, SIDE * SCALE - y


def surfaces() -> dict[str, tuple[Points, Points]]:
    """Return points along the right half of each surface, with distances from the other one, by its name."""
    angles = np.linspace(-0.5, 0.5, 4001) * np.pi
    ball = np.column_stack([np.cos(angles), 0.5 + np.sin(angles), 0.0 * angles])
    x = np.linspace(0.0, 1.5, 4001)
    top = np.column_stack([x, 0.0 * x, 0.0 * x])
    return {"bar": (ball, ball[:, 1]), "ball": (top, np.hypot(x, 0.5) - 1.0)}


def panel(rounded: Node, sharp: Node, font: ImageFont.FreeTypeFont | ImageFont.ImageFont) -> Image.Image:
    """Return a section with the marks of where arcs begin."""
    size = SIDE * SCALE
    across = SPAN * ((np.arange(size) + 0.5) / size - 0.5)
    points = np.stack(np.broadcast_arrays(across, -across[:, None], 0.0), axis=-1).reshape(-1, 3)
    pixels = np.full((size * size, 3), 255, np.uint8)
    pixels[sharp(points) >= 0.5] = 226
    pixels[rounded(points) >= 0.5] = CLAY
    picture = Image.fromarray(pixels.reshape(size, size, 3))
    draw = ImageDraw.Draw(picture)
    texts = []
    for name, (places, distances) in surfaces().items():
        values = sharp(places)
        away = np.where(np.abs(values - 0.5) < EXACT, np.abs(rounded(places) - values), 0.0)
        arc = np.flatnonzero(away > DEPARTED)
        end = arc[np.abs(distances[arc]).argmax()]
        x, y = pixel(places[end])
        draw.ellipse((x - 9, y - 9, x + 9, y + 9), fill=MARK)
        texts.append(f"{abs(distances[end]):.2f} from the {name}")
    draw.text((size // 2, size - 30), ", ".join(texts), fill=INK, font=font, anchor="mm")
    return picture


def draw(path: Path) -> None:
    """Write the picture."""
    font = ImageFont.load_default(size=26)
    panels = [panel(rounded, sharp, font) for rounded, sharp in zip(ROUNDED, SHARP, strict=True)]
    picture = Image.new("RGB", (len(panels) * SIDE * SCALE, SIDE * SCALE))
    for column, image in enumerate(panels):
        picture.paste(image, (column * SIDE * SCALE, 0))
    picture = picture.resize((len(panels) * SIDE, SIDE), Image.Resampling.LANCZOS)
    picture.quantize(64).save(path, optimize=True)


if __name__ == "__main__":
    draw(Path(__file__).parent / "images" / "widths.png")
