"""A steel rivet on its washer, cut out: everything around it is transparent."""

import numpy as np

from .canvas import Canvas, Color, Field, light, mix, rgb, shine, smoothstep
from .noise import fractal_noise

COLOR = rgb("#9aa0a8")
EDGE = 0.88
HEAD = 0.62


def paint(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint a domed head on a flat washer, brushed in circles, with oil in the corner between them."""
    x, y, rho = canvas.x, canvas.y, canvas.rho
    brushed = fractal_noise(48.0 * rho, 2.0 * x / np.maximum(rho, 0.05) + 5.0, octaves=2, seed=9)
    patina = fractal_noise(3.0 * x, 3.0 * y, octaves=4, seed=14)
    head = np.sqrt(np.maximum(1.0 - (rho / HEAD) ** 2, 0.0))
    washer = smoothstep(EDGE, EDGE - 0.07, rho)
    height = 0.42 * head + 0.07 * washer + 0.004 * brushed * smoothstep(0.05, 0.4, rho)

    r, g, b = base
    rust = (0.52, 0.30, 0.16)
    color = mix((0.55 * r, 0.57 * g, 0.62 * b), base, 0.55 + 0.45 * brushed)
    color = mix(
        color, rust, 0.55 * smoothstep(0.35, 0.75, patina) * smoothstep(0.09, 0.0, np.abs(rho - HEAD))
    )
    color = color * light(canvas, height, ambient=0.30)[..., None]
    oil = np.exp(-(((rho - HEAD) / 0.035) ** 2))
    color = (
        color * (1.0 - 0.80 * oil)[..., None] * (0.35 + 0.65 * smoothstep(EDGE, EDGE - 0.05, rho))[..., None]
    )
    gloss = 0.75 * shine(canvas, height, sharpness=130.0) * smoothstep(HEAD, HEAD - 0.08, rho)
    color = color + (gloss + 0.12 * shine(canvas, height, sharpness=8.0))[..., None]
    return color, canvas.below(rho, EDGE)
