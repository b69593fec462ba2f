"""A reptile's scale: keeled along +u, ridged across it, closed by a dark border."""

import numpy as np

from .canvas import Canvas, Color, Field, Vector, dark_ring, light, mix, rgb, shine, smoothstep
from .noise import fractal_noise

COLOR = rgb("#6aa53c")
SUN: Vector = (0.34, 0.0, 0.94)
"""Light from the tip, so that both sides of the keel are alike."""


def paint(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint the scale; it points along +u and is the same above and below its keel."""
    x, y, rho = canvas.x, np.abs(canvas.y), canvas.rho
    keel = np.exp(-((y / (0.075 + 0.06 * smoothstep(1.0, -0.8, x))) ** 2))
    keel = keel * smoothstep(-0.95, -0.40, x) * smoothstep(0.98, 0.50, x)
    # Growth rings around a focus near the root, so the outermost follow the scale's own edge.
    reach = np.hypot(x + 0.66, y)
    mottle = fractal_noise(x * 3.2, y * 3.2 + 40.0, octaves=4, seed=11)
    phase = (reach + 0.05 * (mottle - 0.5)) * 5.4
    rings = phase - np.floor(phase)
    rings = smoothstep(0.0, 0.30, rings) * (1.0 - rings * rings)
    angle = np.arctan2(y, x + 0.66)
    fibre = fractal_noise(angle * 11.0, reach * 2.5, octaves=3, seed=19)
    dome = np.sqrt(np.maximum(1.04 - rho * rho, 0.0))
    inside = smoothstep(0.99, 0.75, rho) * smoothstep(0.15, 0.50, reach)
    height = 0.50 * dome + 0.17 * keel + inside * (0.030 * rings + 0.010 * fibre)

    r, g, b = base
    deep = (0.22 * r, 0.34 * g, 0.42 * b)
    pale = (0.45 * r + 0.55, 0.40 * g + 0.58, 0.55 * b + 0.22)
    color = mix(deep, base, smoothstep(-1.0, 0.0, x + 0.5 * (mottle - 0.5)))
    color = mix(color, pale, 0.62 * smoothstep(0.05, 1.0, x - 0.25 * y + 0.4 * (mottle - 0.5)))
    color = mix(color, pale, 0.50 * keel)
    color = color * (0.86 + inside * (0.22 * rings + 0.34 * (fibre - 0.5)) + 0.30 * (mottle - 0.5))[..., None]
    color = color * light(canvas, height, ambient=0.45, sun=SUN)[..., None]
    color = color + 0.20 * shine(canvas, height, sharpness=22.0, sun=SUN)[..., None]
    return dark_ring(canvas, color, width=0.055), np.ones_like(rho)
