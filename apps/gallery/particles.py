"""Particles and decals
====================

Figures 10 and 11 of the paper: 1,000 particles that repel each other on a surface, and the decals at
their positions.
"""

from collections.abc import Sequence

from decals import Contact, DecalImage, Scene, scatter
from decals.apps.gallery.helpers import Panel, main, ring_image, sample_camera
from decals.apps.models.samples import sample

COUNT = 1000


def panels() -> Sequence[Panel]:
    """Draw the particles on the knot as small dots, then the decals."""
    knot = sample("knot")
    camera = sample_camera("knot")
    decals = scatter(knot.surface, count=COUNT)
    dots = decals.replace(radii=0.18 * decals.radii)
    return [
        Panel(Scene(objects=(knot,), camera=camera, images=images, decals=marks), contact=Contact.PRODUCT)
        for marks, images in (
            (dots, (ring_image((60, 60, 70)),)),
            (decals, (DecalImage.load("scale#4d8a57"),)),
        )
    ]


if __name__ == "__main__":
    main(panels)
