"""Figures 10 and 11 of the paper: particles spread over a surface, and the decals that take their places."""

from collections.abc import Sequence

from decals.coat.seeding import seed
from decals.scenes.scene import DecalImage, Scene

from ..models.samples import axes_of, sample
from ..views import frame, parse_view
from .panels import Panel, main
from .stage import rings

COUNT = 500


def panels() -> Sequence[Panel]:
    """Show the particles on the knot as small dots, then the decals."""
    knot = sample("knot")
    camera = frame([knot], parse_view(None, axes_of("knot")), (1, 1))
    decals = seed(knot.surface, count=COUNT)
    dots = decals.replace(radii=0.18 * decals.radii)
    return [
        Panel(Scene(objects=(knot,), camera=camera, images=images, decals=lying))
        for lying, images in ((dots, (rings((60, 60, 70)),)), (decals, (DecalImage.load("scale#4d8a57"),)))
    ]


if __name__ == "__main__":
    main(panels)
