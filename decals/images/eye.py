"""A reptile's eye: slit pupil, fibrous iris, wet glint; cut out."""

import numpy as np

from .canvas import Canvas, Color, Field, mix, rgb, smoothstep
from .noise import fractal_noise

COLOR = rgb("#e0a11c")
EDGE = 0.94
IRIS = 0.74


def paint(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint the eye looking straight ahead; the slit stands along v."""
    x, y, rho = canvas.x, canvas.y, canvas.rho
    angle = np.arctan2(y, x)
    # Fibres run outward: fine around, slow along. Cosine and sine of the angle leave no seam.
    around_x, around_y = 15.0 * np.cos(angle), 15.0 * np.sin(angle)
    fibres = fractal_noise(around_x + 1.3 * rho, around_y + 1.3 * rho, octaves=4, seed=2)
    flecks = fractal_noise(9.0 * x, 9.0 * y + 4.0, octaves=3, seed=8)
    slit = np.hypot(x / 0.155, y / 0.62) + 0.10 * (fibres - 0.5)

    r, g, b = base
    lit = (0.35 * r + 0.65, 0.45 * g + 0.52, 0.6 * b + 0.16)
    dark = (0.42 * r, 0.26 * g, 0.25 * b)
    iris = mix(base, lit, smoothstep(0.45, 0.72, fibres) * smoothstep(0.8, 0.3, rho))
    iris = mix(iris, dark, 0.8 * smoothstep(0.52, 0.30, fibres))
    iris = mix(iris, dark, 0.55 * smoothstep(0.55, 0.72, flecks))
    iris = mix(iris, lit, 0.7 * smoothstep(1.55, 1.05, slit))
    iris = mix(iris, (0.05, 0.03, 0.02), smoothstep(IRIS - 0.16, IRIS + 0.01, rho))
    iris = mix(iris, (0.01, 0.01, 0.015), smoothstep(1.07, 0.97, slit))

    white = mix((0.86, 0.80, 0.66), (0.30, 0.16, 0.10), smoothstep(IRIS, EDGE, rho))
    color = mix(iris, white, smoothstep(IRIS - 0.005, IRIS + 0.035, rho))
    color = mix(color, (0.03, 0.02, 0.02), smoothstep(EDGE - 0.10, EDGE - 0.015, rho))
    ball = np.sqrt(np.maximum(1.0 - (rho / EDGE) ** 2, 0.0))
    color = color * (0.62 + 0.46 * ball + 0.16 * y)[..., None]
    glint = smoothstep(1.0, 0.72, np.hypot((x + 0.27) / 0.17, (y - 0.31) / 0.13))
    echo = smoothstep(1.0, 0.2, np.hypot((x - 0.26) / 0.16, (y + 0.33) / 0.10))
    color = color + (0.95 * glint + 0.22 * echo)[..., None]
    return color, canvas.below(rho, EDGE)
