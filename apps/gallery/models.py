"""Figure 12 of the paper: the knot, implicit spheres and the horse."""

from collections.abc import Sequence

from decals.coat.seeding import seed
from decals.scenes.scene import DecalImage, Scene

from ..models.samples import axes_of, sample
from ..views import frame, parse_view
from .panels import Panel, main

LOOKS = {
    "knot": (400, ("tile#2f7f95", "tile#c9a227", "tile#b5533c")),
    "spheres": (500, ("rock", "rock#8a7f70")),
    "horse": (900, ("scale#8a5a34", "scale#a9733f")),
}
"""Number of decals and images of each model."""


def panels() -> Sequence[Panel]:
    """Cover each model."""
    made = []
    for name, (count, images) in LOOKS.items():
        item = sample(name)
        scene = Scene(
            objects=(item,),
            camera=frame([item], parse_view(None, axes_of(name)), (1, 1)),
            images=tuple(DecalImage.load(image) for image in images),
            decals=seed(item.surface, count=count, images=len(images)),
        )
        made.append(Panel(scene))
    return made


if __name__ == "__main__":
    main(panels)
