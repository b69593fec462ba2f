"""Scenes side by side in one picture."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.model import Decals
from decals.render import Renderer
from decals.scenes.scene import Scene

from ..machine.warp_start import start_warp
from ..output import write_picture

SIDE = 300
"""Width and height of a panel, in pixels."""
GAP = 4
_PAPER = 255


@dataclass(frozen=True)
class Panel:
    """A scene, and how its decals lie."""

    scene: Scene
    contact: Contact = Contact.PAPER
    mapping: Mapping = Mapping.CORRECTED


def draw(
    renderer: Renderer, panels: Sequence[Panel], *, side: int = SIDE, samples: int = 3
) -> NDArray[np.uint8]:
    """Draw panels from left to right, ``uint8[side, ..., 4]``."""
    pictures = [
        renderer.render(
            panel.scene,
            size=(side, side),
            samples=samples,
            contact=panel.contact,
            mapping=panel.mapping,
        )
        for panel in panels
    ]
    width = len(pictures) * (side + GAP) - GAP
    row = np.full((side, width, 4), _PAPER, np.uint8)
    for number, picture in enumerate(pictures):
        left = number * (side + GAP)
        row[:, left : left + side] = picture
    return row


def decal(
    position: ArrayLike,
    normal: ArrayLike,
    radius: float,
    *,
    tangent: ArrayLike = (1.0, 0.0, 0.0),
    image: int = 0,
) -> Decals:
    """Make one decal."""
    return Decals(
        positions=np.array([position], np.float32),
        normals=np.array([normal], np.float32),
        tangents=np.array([tangent], np.float32),
        radii=np.array([radius], np.float32),
        images=np.array([image], np.int32),
    )


def main(panels: Callable[[], Sequence[Panel]]) -> None:
    """Draw an example from the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("-o", "--output", type=Path, default=Path("picture.png"))
    parser.add_argument("--side", type=int, default=SIDE, help="width and height of a panel, in pixels")
    options = parser.parse_args()
    start_warp()
    with Renderer() as renderer:
        write_picture(options.output, draw(renderer, panels(), side=options.side))
