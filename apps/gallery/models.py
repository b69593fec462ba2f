"""Three models
============

Figure 12 of the paper: tiles on a knot, rocks on implicit spheres, scales on a horse.
"""

from collections.abc import Sequence

from decals import DecalImage, Scene, scatter
from decals.apps.gallery.helpers import Panel, main, sample, sample_camera

COVERS = {
    "knot": (400, ("tile#2f7f95", "tile#c9a227", "tile#b5533c")),
    "spheres": (500, ("rock", "rock#8a7f70")),
    "horse": (900, ("scale#8a5a34", "scale#a9733f")),
}
"""Number of decals and images of each model."""


def panels() -> Sequence[Panel]:
    """Cover each model with decals."""
    panels = []
    for name, (count, images) in COVERS.items():
        model = sample(name)
        scene = Scene(
            objects=(model,),
            camera=sample_camera(name),
            images=tuple(DecalImage.load(image) for image in images),
            decals=scatter(model.surface, count=count, images=len(images)),
        )
        panels.append(Panel(scene))
    return panels


if __name__ == "__main__":
    main(panels)
