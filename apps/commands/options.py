"""Values of options: types, parsers and range checks.

This module imports nothing heavy, so a command that only prints a list is fast.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter, Token

from decals.errors import InvalidInput

if TYPE_CHECKING:
    from decals.apps.views import Size

MAX_EDGE = 16384
"""Longest edge of a picture, in pixels."""
MAX_SAMPLES = 8
TILE = 768
"""Samples per axis that are drawn at once: small enough to interrupt a command within seconds."""
MAX_DECALS = 1_000_000
MAX_SEED = 2**32 - 1
DEFAULT_IMAGES = ("scale",)


def _whole(_type: Any, tokens: Sequence[Token]) -> int:
    return parse_whole(tokens[0].value)


def parse_whole(text: str) -> int:
    """Parse a whole number, also one such as 12.0 or 1e3; reject fractions, which Python would round."""
    if re.fullmatch(r"[+-]?\d+(_\d+)*", text.strip()):
        return int(text)
    number = float(text) if re.fullmatch(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?", text.strip()) else 0.5
    if not number.is_integer():  # infinity is none
        raise ValueError(f"expected a whole number, got {text!r}")
    return int(number)


Whole = Annotated[int, Parameter(converter=_whole)]
"""A whole number on the command line."""
OptionalWhole = Annotated[int | None, Parameter(converter=_whole, show_default=False)]
"""An optional whole number on the command line."""


Definitions = Annotated[
    list[str] | None,
    Parameter(
        name="--define",
        negative=(),
        show_default=False,
        help="A Python file or module that defines the custom nodes of BlobTrees in JSON. Its code is run. "
        "Can be repeated.",
    ),
]
"""Modules that define custom nodes."""

Seed = Annotated[
    OptionalWhole, Parameter(help="Seed of the random numbers: equal seeds give equal decals. Default: 0.")
]
"""An optional seed of scattered decals."""

UpAxis = Annotated[
    Literal["x", "y", "z"] | None,
    Parameter(show_default=False, help="The axis that points upward. Default: y, or the axis of the sample."),
]
"""An optional upward axis on the command line."""

CreaseAngle = Annotated[
    float | None,
    Parameter(
        show_default=False,
        help="Angle between two faces of a mesh, in degrees from 0 to 180, from which their edge is sharp. "
        "Default: 35, or that of a saved scene.",
    ),
]
"""An optional crease angle of meshes, in degrees, on the command line."""

Trust = Annotated[
    bool,
    Parameter(
        name="--trust",
        negative=(),
        show_default=False,
        help="Let a scene read files outside its folder, and any number of images.",
    ),
]
"""Permission for a scene to read files outside its folder."""


@Parameter(name="*")
@dataclass(frozen=True)
class Rules:
    """Options of the rules by which decals are drawn; None leaves the rule to the scene.

    Parameters
    ----------
    contact
        Contact mode: elastic (compresses images at contact lines; never folds one), product (equation 5 of
        the paper), min (only the strongest push counts), or radial (scales images along rays). Default: that
        of the scene, as for the next two, or elastic.
    stiffness
        Stiffness of elastic contact, from 1 to 64: how close to contact lines images are compressed.
        Default: that of the scene, or 2.
    mapping
        Image mapping: corrected for the curvature of the surface, chord (the paper's projection), or walked
        along the shortest path, for edges and corners. Default: that of the scene, or corrected.
    """

    contact: Annotated[
        Literal["product", "min", "radial", "elastic"] | None, Parameter(show_default=False)
    ] = None
    stiffness: Annotated[float | None, Parameter(show_default=False)] = None
    mapping: Annotated[Literal["corrected", "chord", "walked"] | None, Parameter(show_default=False)] = None

    def given(self) -> dict[str, Any]:
        """Return the rules that are given."""
        return given(**vars(self))


@Parameter(name="*")
@dataclass(frozen=True)
class Texture:
    """Options of the texture of a baked scene.

    Parameters
    ----------
    size
        Width and height of the texture in texels, from 16 to 8192.
    samples
        Samples per texel along each axis: 1 is fast, 2 smooth, 4 fine.
    layout
        How surfaces lie on the texture: box, xatlas, own (texture coordinates of the meshes), or auto, the
        one with the shortest seams.
    tiles
        Textures of that size over which the surfaces are spread, as UDIM tiles (glb, gltf, obj).
    """

    size: Whole = 2048
    samples: Whole = 2
    layout: Literal["auto", "box", "xatlas", "own"] = "auto"
    tiles: Whole = 1

    def checked(self) -> dict[str, Any]:
        """Return the options by their names; raise `InvalidInput` for too many samples."""
        check_count("--samples", self.samples, 1, MAX_SAMPLES)
        return vars(self)

    def changed(self) -> dict[str, Any]:
        """Return the options that are not the usual ones."""
        return {name: value for name, value in vars(self).items() if value != getattr(Texture, name)}


@Parameter(name="*")
@dataclass(frozen=True)
class Shown:
    """Options of a page in the browser.

    Parameters
    ----------
    surface
        How a page shows implicit objects: as a mesh (default) or traced, which is exact and slower.
    title
        Title of a page. Default: the names of the objects.
    alt
        What a page shows, for people who do not see it. Default: the objects and the number of decals.
    background
        Colour behind a page's model, such as white. Default: that of the scene.
    controls
        Buttons of a page; mouse, touch and keys work without them.
    """

    surface: Annotated[Literal["mesh", "traced"] | None, Parameter(show_default=False)] = None
    title: Annotated[str | None, Parameter(show_default=False)] = None
    alt: Annotated[str | None, Parameter(show_default=False)] = None
    background: Annotated[str | None, Parameter(show_default=False)] = None
    controls: Annotated[bool | None, Parameter(show_default=False)] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Surfaces:
    """Options of the meshes of implicit objects.

    Parameters
    ----------
    resolution
        Cells along the longest side of each implicit object. Default: 64.
    creases
        Keep the edges that unions, intersections and differences leave.
    """

    resolution: Annotated[OptionalWhole, Parameter(name=("--resolution", "--cells"))] = None
    creases: Annotated[bool, Parameter(negative=())] = False


@Parameter(name="*")
@dataclass(frozen=True)
class Scattered:
    """Options of the decals that are scattered over models.

    Parameters
    ----------
    decals
        Number of decals. Default: 500.
    image
        Image of the decals: eye, rivet, rock, scale, spatter or tile, optionally with a colour
        (scale#b0413e), or a picture file. Can be repeated: each decal then takes one at random. Default:
        scale.
    up, seed
        See `UpAxis` and `Seed`.
    """

    decals: OptionalWhole = None
    image: Annotated[
        list[str] | None, Parameter(name=("--image", "--images"), negative=(), show_default=False)
    ] = None
    up: UpAxis = None
    seed: Seed = None


@Parameter(name="*")
@dataclass(frozen=True)
class Start(Scattered):
    """Options of what `edit` and `sandbox` open with.

    Parameters
    ----------
    decals
        Number of decals scattered at the start. Default: 500.
    image
        Image of the decals, as for render. Can be repeated. A saved scene keeps its images, and these are
        added. Default: scale.
    up, seed
        See `UpAxis` and `Seed`.
    save
        The JSON file that Ctrl + S writes. Default: the opened scene, or a new file such as MODEL-decals.json
        or scene.json.
    """

    save: Path | None = None


@Parameter(name="*")
@dataclass(frozen=True)
class Inputs:
    """Options of what a command reads beside its models.

    Parameters
    ----------
    table
        Table of decals that scatter wrote (csv or parquet), in place of the decals of a saved scene.
    define, trust
        See `Definitions` and `Trust`.
    """

    table: Annotated[Path | None, Parameter(show_default=False)] = None
    define: Definitions = None
    trust: Trust = False


def parse_size(text: str) -> "Size":
    """Parse a picture size such as ``"1200x900"``."""
    match = re.fullmatch(r"(\d{1,9})[xX×](\d{1,9})", text.strip())
    if match is None:
        raise InvalidInput(f"--size: expected WIDTHxHEIGHT such as 1200x900, got {text!r}")
    width, height = int(match[1]), int(match[2])
    if not (1 <= width <= MAX_EDGE and 1 <= height <= MAX_EDGE):
        raise InvalidInput(f"--size: expected 1 to {MAX_EDGE} pixels a side, got {text!r}")
    return width, height


def check_count(option: str, value: int, low: int, high: int) -> None:
    """Raise `InvalidInput` if a whole number lies outside its range."""
    if not low <= value <= high:
        raise InvalidInput(f"{option}: expected a whole number from {low} to {high}, got {value}")


def given(**options: Any) -> dict[str, Any]:
    """Return the options that are not None; the function that they are passed to decides about the others."""
    return {name: value for name, value in options.items() if value is not None}
