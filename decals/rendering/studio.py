"""The studio's environment: smooth lobes of light, which reflections on materials of any roughness show.

The radiance from a direction d in the camera's frame (right, up, back) is a gradient from the ground to the
sky, and a sum of spherical Gaussians exp(λ (d·μ − 1)) of which each is a large lamp. A rough surface sees it
through a lobe. The convolution of two such Gaussians is nearly one again, so the environment is prefiltered
for every roughness in closed form, without a texture.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Color = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Lamp:
    """A lamp: its direction in the camera's frame, sharpness λ of its edge, and radiance at its middle."""

    direction: Color
    sharpness: float
    color: Color


SKY: Color = (0.33, 0.35, 0.39)
GROUND: Color = (0.13, 0.11, 0.10)
"""Radiance from above and below, which is the ambient light of ``shaders/studio_light.glsl`` too."""

LAMPS = (
    Lamp((-0.75, 0.55, 0.35), 14.0, (2.6, 2.5, 2.3)),
    Lamp((0.85, 0.10, 0.45), 22.0, (1.1, 1.2, 1.4)),
    Lamp((0.10, 0.75, -0.65), 9.0, (1.3, 1.3, 1.4)),
)


def studio_constants() -> str:
    """Return the environment as constants of GLSL, for ``shaders/studio_environment.glsl``."""
    axes, colors = [], []
    for lamp in LAMPS:
        axis = np.asarray(lamp.direction) / np.linalg.norm(lamp.direction)
        axes.append(f"vec4({', '.join(map(repr, axis.tolist()))}, {lamp.sharpness!r})")
        colors.append(_vector(lamp.color))
    count = len(LAMPS)
    return (
        f"const int ENVIRONMENT_LOBES = {count};\n"
        f"const vec4 environment_axes[{count}] = vec4[]({', '.join(axes)});\n"
        f"const vec3 environment_colors[{count}] = vec3[]({', '.join(colors)});\n"
    )


ENVIRONMENTS: dict[str, Callable[[], str]] = {"studio": studio_constants}
"""Functions that return the constants of each kind of environment, by the beginning of its shader's name."""


def studio_ambient() -> dict[str, str]:
    """Return the light from above and below as definitions for both shaders of the studio."""
    return {"SKY_COLOR": _vector(SKY), "GROUND_COLOR": _vector(GROUND)}


def _vector(color: Color) -> str:
    return f"vec3({', '.join(map(repr, color))})"
