"""Draw the picture of zones in docs/scattering.md: ``python docs/draw_zones.py``."""

import numpy as np
from pictures import DOCS, code_of, run_code
from PIL import Image

import decals

SIZE = (560, 420)
IMAGES = ("scale#3f7d58", "tile#c9a227", "rock#b0413e")
VIEW = (0.35, 0.5, 1.0)


def main() -> None:
    """Draw the decals of the page's example with both kinds of borders, side by side."""
    names = run_code(code_of(DOCS / "scattering.md"))
    scene = decals.cover(names["figure"], count=1, images=IMAGES, view_direction=VIEW)
    pictures = [
        np.asarray(decals.render(scene.replace(decals=names[name]), size=SIZE, background="white").pixels)
        for name in ("pressed", "mixed")
    ]
    row = np.concatenate(pictures, axis=1)[..., :3]
    Image.fromarray(row).save(DOCS / "images" / "zones.jpg", quality=88)


if __name__ == "__main__":
    main()
