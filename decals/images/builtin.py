"""Generated decal images, by name: eye, rivet, rock, scale, spatter and tile."""

import re
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from decals.errors import InvalidImage
from decals.images.canvas import (
    Canvas,
    Color,
    Field,
    Vector,
    cell_noise,
    dark_ring,
    draw,
    fractal_noise,
    light,
    mix,
    rgb,
    shine,
    smoothstep,
)
from decals.validation import instance, whole_number

EYE_COLOR = rgb("#e0a11c")
EYE_EDGE = 0.94
EYE_IRIS = 0.74


def paint_eye(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint a reptile's eye with a slit pupil along v, cut out of a transparent square."""
    x, y, rho = canvas.x, canvas.y, canvas.rho
    angle = np.arctan2(y, x)
    # Fibres run outward: fine around the circle, coarse along the radius. Cosine and sine avoid a seam.
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
    iris = mix(iris, (0.05, 0.03, 0.02), smoothstep(EYE_IRIS - 0.16, EYE_IRIS + 0.01, rho))
    iris = mix(iris, (0.01, 0.01, 0.015), smoothstep(1.07, 0.97, slit))

    white = mix((0.86, 0.80, 0.66), (0.30, 0.16, 0.10), smoothstep(EYE_IRIS, EYE_EDGE, rho))
    color = mix(iris, white, smoothstep(EYE_IRIS - 0.005, EYE_IRIS + 0.035, rho))
    color = mix(color, (0.03, 0.02, 0.02), smoothstep(EYE_EDGE - 0.10, EYE_EDGE - 0.015, rho))
    ball = np.sqrt(np.maximum(1.0 - (rho / EYE_EDGE) ** 2, 0.0))
    color = color * (0.62 + 0.46 * ball + 0.16 * y)[..., None]
    glint = smoothstep(1.0, 0.72, np.hypot((x + 0.27) / 0.17, (y - 0.31) / 0.13))
    echo = smoothstep(1.0, 0.2, np.hypot((x - 0.26) / 0.16, (y + 0.33) / 0.10))
    color = color + (0.95 * glint + 0.22 * echo)[..., None]
    return color, canvas.below(rho, EYE_EDGE)


RIVET_COLOR = rgb("#9aa0a8")
RIVET_EDGE = 0.88
RIVET_HEAD = 0.62


def paint_rivet(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint a rivet: a domed head on a flat washer, brushed in circles, with oil between them."""
    x, y, rho = canvas.x, canvas.y, canvas.rho
    brushed = fractal_noise(48.0 * rho, 2.0 * x / np.maximum(rho, 0.05) + 5.0, octaves=2, seed=9)
    patina = fractal_noise(3.0 * x, 3.0 * y, octaves=4, seed=14)
    head = np.sqrt(np.maximum(1.0 - (rho / RIVET_HEAD) ** 2, 0.0))
    washer = smoothstep(RIVET_EDGE, RIVET_EDGE - 0.07, rho)
    height = 0.42 * head + 0.07 * washer + 0.004 * brushed * smoothstep(0.05, 0.4, rho)

    r, g, b = base
    rust = (0.52, 0.30, 0.16)
    color = mix((0.55 * r, 0.57 * g, 0.62 * b), base, 0.55 + 0.45 * brushed)
    color = mix(
        color, rust, 0.55 * smoothstep(0.35, 0.75, patina) * smoothstep(0.09, 0.0, np.abs(rho - RIVET_HEAD))
    )
    color = color * light(canvas, height, ambient=0.30)[..., None]
    oil = np.exp(-(((rho - RIVET_HEAD) / 0.035) ** 2))
    color = (
        color
        * (1.0 - 0.80 * oil)[..., None]
        * (0.35 + 0.65 * smoothstep(RIVET_EDGE, RIVET_EDGE - 0.05, rho))[..., None]
    )
    gloss = 0.75 * shine(canvas, height, sharpness=130.0) * smoothstep(RIVET_HEAD, RIVET_HEAD - 0.08, rho)
    color = color + (gloss + 0.12 * shine(canvas, height, sharpness=8.0))[..., None]
    return color, canvas.below(rho, RIVET_EDGE)


ROCK_COLOR = rgb("#aaa090")


def paint_rock(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint a weathered rock with cracks, pits and lichen."""
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


SCALE_COLOR = rgb("#6aa53c")
SCALE_SUN: Vector = (0.34, 0.0, 0.94)
"""Direction of the light: from the tip, so that both sides of the keel are equal."""


def paint_scale(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint a reptile's scale that points along +u, symmetric about its keel."""
    x, y, rho = canvas.x, np.abs(canvas.y), canvas.rho
    keel = np.exp(-((y / (0.075 + 0.06 * smoothstep(1.0, -0.8, x))) ** 2))
    keel = keel * smoothstep(-0.95, -0.40, x) * smoothstep(0.98, 0.50, x)
    # Growth rings around a focus near the root, so that the outermost ones follow the edge of the scale.
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
    color = color * light(canvas, height, ambient=0.45, sun=SCALE_SUN)[..., None]
    color = color + 0.20 * shine(canvas, height, sharpness=22.0, sun=SCALE_SUN)[..., None]
    return dark_ring(canvas, color, width=0.055), np.ones_like(rho)


SPATTER_COLOR = rgb("#8c1512")
SPATTER_EDGE = 0.97
SPATTER_BLOT = 0.5
"""Mean radius of the blot in the middle."""


def paint_spatter(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint a stain of thick liquid: a blot with rays, and drops that grow smaller outward."""
    x, y, rho = canvas.x, canvas.y, canvas.rho
    angle = np.arctan2(y, x)
    around_x, around_y = np.cos(angle), np.sin(angle)
    lobes = fractal_noise(2.2 * around_x + 5.0, 2.2 * around_y, octaves=3, seed=4)
    rays = fractal_noise(7.0 * around_x, 7.0 * around_y + 3.0, octaves=2, seed=12)
    blot = SPATTER_BLOT + 0.5 * (lobes - 0.5) + 0.85 * np.maximum(rays - 0.62, 0.0)
    drops = np.maximum.reduce(
        [
            (0.62 - 0.42 * rho) / grain - cell_noise(grain * x + seed, grain * y - seed, seed=seed)[0] / grain
            for grain, seed in ((3.2, 6), (6.5, 23))
        ]
    )
    inner = np.maximum(blot - rho, 0.55 * drops - 0.035)
    inside = np.minimum(inner, SPATTER_EDGE - rho)

    r, g, b = base
    thick = smoothstep(0.02, 0.12, inner)
    height = 0.10 * smoothstep(0.0, 0.07, inner)
    color = mix((0.78 * r, 0.62 * g, 0.62 * b), (0.45 * r, 0.35 * g, 0.35 * b), thick)
    color = color * light(canvas, height, ambient=0.6)[..., None]
    color = color + (0.55 * shine(canvas, height, sharpness=90.0))[..., None]
    return color, canvas.below(-inside, 0.0)


TILE_COLOR = rgb("#2f7f95")


def paint_tile(canvas: Canvas, base: Color) -> tuple[Field, Field]:
    """Paint a glazed tile: a level face with a bevel, over which the glaze is thin."""
    x, y, rho = canvas.x, canvas.y, canvas.rho
    bevel = smoothstep(1.0, 0.76, rho)
    waves = fractal_noise(1.6 * x + 3.0, 1.6 * y, octaves=3, seed=5)
    near, next_near = cell_noise(4.5 * x + 0.5 * waves, 4.5 * y + 9.0, seed=31)
    crackle = smoothstep(0.022, 0.0, next_near - near) * bevel
    height = 0.20 * bevel + 0.02 * waves - 0.08 * rho * rho

    r, g, b = base
    pool = (0.55 * r, 0.62 * g, 0.72 * b)
    thin = (0.35 * r + 0.60, 0.35 * g + 0.62, 0.35 * b + 0.58)
    # The glaze is thick in the middle of the face, and pale over the edge.
    color = mix(base, pool, 0.45 * smoothstep(0.15, 0.85, waves))
    color = mix(color, thin, 0.62 * smoothstep(0.70, 0.86, rho) * smoothstep(1.02, 0.90, rho))
    color = color * (1.0 - 0.22 * crackle)[..., None]
    color = color * light(canvas, height, ambient=0.5)[..., None]
    gloss = 0.5 * shine(canvas, height, sharpness=110.0) + 0.05 * shine(canvas, height, sharpness=12.0)
    window = np.exp(-(((x + 0.30) / 0.34) ** 2 + ((y - 0.36) / 0.18) ** 2)) * (0.6 + 0.8 * waves)
    color = color + (gloss + 0.30 * window)[..., None]
    return dark_ring(canvas, color, width=0.06), np.ones_like(rho)


_PAINTERS = {
    "eye": (paint_eye, EYE_COLOR),
    "rivet": (paint_rivet, RIVET_COLOR),
    "rock": (paint_rock, ROCK_COLOR),
    "scale": (paint_scale, SCALE_COLOR),
    "spatter": (paint_spatter, SPATTER_COLOR),
    "tile": (paint_tile, TILE_COLOR),
}

BUILTIN_IMAGES: tuple[str, ...] = tuple(sorted(_PAINTERS))
"""Names of the generated images; ``"name#rrggbb"`` draws one in another colour."""

MAX_GENERATED_EDGE = 4096
_REFERENCE = re.compile(r"(?P<name>[a-z]+)(?:#(?P<color>[0-9a-fA-F]{6}))?")


def is_builtin(reference: str) -> bool:
    """Return True if a reference names a generated image rather than a file.

    Parameters
    ----------
    reference : str
        The name of a generated image, with an optional colour, or the path of a picture.

    Returns
    -------
    bool
        True for the references that `generate_image` accepts.

    Examples
    --------
    >>> from decals.images import is_builtin
    >>> is_builtin("tile#b0413e")
    True
    >>> is_builtin("tile.png")
    False
    """
    match = _REFERENCE.fullmatch(reference)
    return match is not None and match["name"] in _PAINTERS


def generate_image(reference: str, size: int = 256) -> NDArray[np.uint8]:
    """Generate one of the built-in decal images.

    The decal's rim is the circle inscribed in the square. ``scale``, ``rock`` and ``tile`` are opaque and end
    in a near-black ring, the contact line between neighbours (paper, figure 8); ``rivet``, ``eye`` and
    ``spatter`` are cut out of a transparent square.

    Parameters
    ----------
    reference : str
        A name of `BUILTIN_IMAGES`, with an optional colour: ``"tile"``, ``"tile#b0413e"``.
    size : int, optional
        Edge in pixels, 1 to 4096. Default 256.

    Returns
    -------
    uint8[size, size, 4]
        sRGB with straight alpha, row 0 at the top (v = 1). Read-only, and equal in every call.

    Raises
    ------
    InvalidImage
        There is no such image, or the size is out of range.

    See Also
    --------
    load_image : a generated image, or a picture from a file.

    Examples
    --------
    >>> import decals
    >>> decals.images.BUILTIN_IMAGES
    ('eye', 'rivet', 'rock', 'scale', 'spatter', 'tile')
    >>> decals.images.generate_image("tile#b0413e", size=64).shape
    (64, 64, 4)
    """
    instance("image", reference, str, InvalidImage, f"such as {BUILTIN_IMAGES[0]!r}")
    match = _REFERENCE.fullmatch(reference)
    name, mark, _ = reference.partition("#")
    if match is None and mark and name in _PAINTERS:
        raise InvalidImage(
            f"expected a colour of six hexadecimal digits, such as {name + '#b0413e'!r}, got {reference!r}; "
            f"or leave it out; images are {', '.join(BUILTIN_IMAGES)}"
        )
    if match is None or match["name"] not in _PAINTERS:
        names = ", ".join(BUILTIN_IMAGES)
        raise InvalidImage(f"expected one of the images {names} (or NAME#rrggbb), got {reference!r}")
    return _drawn(reference, whole_number("size of an image", size, 1, MAX_GENERATED_EDGE, InvalidImage))


@lru_cache(maxsize=32)
def _drawn(reference: str, size: int) -> NDArray[np.uint8]:
    """Return the image of a valid reference."""
    name, _, color = reference.partition("#")
    paint, default = _PAINTERS[name]
    base: Color = rgb(color) if color else default
    pixels = draw(partial(paint, base=base), size)
    pixels.flags.writeable = False
    return pixels
