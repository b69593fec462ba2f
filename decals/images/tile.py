"""A glazed ceramic tile: bevelled, faintly crackled, glossy, closed by dark grout."""

import numpy as np

from .canvas import Canvas, Color, Field, dark_ring, light, mix, rgb, shine, smoothstep
from .noise import cell_noise, fractal_noise

COLOR = rgb("#2f7f95")


def paint(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint the tile: a level face with a glaze that thins over the bevel."""
    x, y, rho = canvas.x, canvas.y, canvas.rho
    bevel = smoothstep(1.0, 0.76, rho)
    waves = fractal_noise(1.6 * x + 3.0, 1.6 * y, octaves=3, seed=5)
    near, next_near = cell_noise(4.5 * x + 0.5 * waves, 4.5 * y + 9.0, seed=31)
    crackle = smoothstep(0.022, 0.0, next_near - near) * bevel
    height = 0.20 * bevel + 0.02 * waves - 0.08 * rho * rho

    r, g, b = base
    pool = (0.55 * r, 0.62 * g, 0.72 * b)
    thin = (0.35 * r + 0.60, 0.35 * g + 0.62, 0.35 * b + 0.58)
    # Glaze pools toward the middle of the face and breaks pale over the edge.
    color = mix(base, pool, 0.45 * smoothstep(0.15, 0.85, waves))
    color = mix(color, thin, 0.62 * smoothstep(0.70, 0.86, rho) * smoothstep(1.02, 0.90, rho))
    color = color * (1.0 - 0.22 * crackle)[..., None]
    color = color * light(canvas, height, ambient=0.5)[..., None]
    gloss = 0.5 * shine(canvas, height, sharpness=110.0) + 0.05 * shine(canvas, height, sharpness=12.0)
    window = np.exp(-(((x + 0.30) / 0.34) ** 2 + ((y - 0.36) / 0.18) ** 2)) * (0.6 + 0.8 * waves)
    color = color + (gloss + 0.30 * window)[..., None]
    return dark_ring(canvas, color, width=0.06), np.ones_like(rho)
