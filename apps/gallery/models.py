"""Three models
============

Figure 12 of the paper: tiles on a knot, and part of them from near; rocks on implicit spheres; scales on a
horse. With ``--side 2160`` the panels have the height of a 4k picture.
"""

from collections.abc import Sequence

from decals import Contact, DecalImage, Scene, scatter
from decals.apps.gallery.helpers import Panel, camera_at, main, sample_camera
from decals.apps.models.samples import sample
from decals.images import generate_image

COVERS = {
    "knot": (400, ("tile#2f7f95", "tile#c9a227", "tile#b5533c")),
    "spheres": (500, ("rock", "rock#8a7f70")),
    "horse": (900, ("scale#8a5a34", "scale#a9733f")),
}
"""Number of decals and images of each model."""

CLOSE_UP = (1.6, 2.4, 5.0), (0.5, 0.55, 0.6)
"""Position and target of the camera that is near the knot."""


def panels() -> Sequence[Panel]:
    """Cover each model with decals, and look at the knot from near too."""
    panels = []
    for name, (count, images) in COVERS.items():
        model = sample(name)
        scene = Scene(
            objects=(model,),
            camera=sample_camera(name),
            images=tuple(DecalImage(image, generate_image(image, 512)) for image in images),
            decals=scatter(model.surface, count=count, images=len(images)),
        )
        panels.append(Panel(scene, contact=Contact.PRODUCT))
        if name == "knot":
            close = scene.replace(camera=camera_at(*CLOSE_UP, fov=16.0))
            panels.append(Panel(close, contact=Contact.PRODUCT))
    return panels


if __name__ == "__main__":
    main(panels)
