"""A weathered pebble: lumps, pits, veins and lichen, closed by a dark border."""

import numpy as np

from .canvas import Canvas, Color, Field, dark_ring, light, mix, rgb, smoothstep
from .noise import cell_noise, fractal_noise

COLOR = rgb("#aaa090")


def paint(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint the rock."""
    x, y, rho = canvas.x, canvas.y, canvas.rho
    warp = fractal_noise(2.2 * x + 4.0, 2.2 * y, octaves=4, seed=3) - 0.5
    lumps = fractal_noise(1.7 * x, 1.7 * y + 9.0, octaves=6, seed=21)
    grit = fractal_noise(21.0 * x, 21.0 * y, octaves=4, seed=40)
    near, next_near = cell_noise(2.3 * x + 1.3 * warp + 5.0, 2.3 * y - 1.3 * warp, seed=7)
    crack = smoothstep(0.055, 0.0, next_near - near) * smoothstep(0.35, 0.62, lumps)
    pits = smoothstep(0.30, 0.12, cell_noise(8.0 * x, 8.0 * y + 2.0, seed=17)[0])
    dome = np.sqrt(np.maximum(1.03 - rho * rho, 0.0))
    facet = 0.10 * next_near
    height = 0.5 * dome + 0.26 * lumps + facet + 0.035 * grit - 0.05 * crack - 0.015 * pits

    r, g, b = base
    cold = (0.62 * r, 0.66 * g, 0.74 * b)
    warm = (min(1.0, 1.25 * r), 1.18 * g, 1.04 * b)
    color = mix(cold, base, smoothstep(0.30, 0.52, lumps))
    color = mix(color, warm, 0.8 * smoothstep(0.50, 0.72, lumps + 0.3 * warp))
    lichen = smoothstep(0.60, 0.70, fractal_noise(3.1 * x - 8.0, 3.1 * y + 2.0, octaves=5, seed=60))
    color = mix(color, (0.60, 0.62, 0.30), 0.60 * lichen)
    color = color * (0.80 + 0.60 * grit)[..., None] * (1.0 - 0.65 * crack - 0.22 * pits)[..., None]
    color = color * (light(canvas, height, ambient=0.38) * (0.72 + 0.36 * dome))[..., None]
    return dark_ring(canvas, color, width=0.06), np.ones_like(rho)
