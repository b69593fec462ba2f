"""Write the pages with models that can be dragged, which the documentation shows in its own pages."""

from importlib import import_module
from pathlib import Path

import decals
from blobtree import Point, Segment

GALLERY = {"sphere": 1, "touching": 1, "layers": 0}
"""Examples of the gallery, and the panel of each, that are pages too."""


def write(folder: Path) -> None:
    """Write all example pages into a folder, which is made if it is missing."""
    folder.mkdir(exist_ok=True)
    tree = Point((0, 0, 0), radius=1.0) | Segment((0.5, 0, 0), (2, 0, 0), radius=0.4)
    scene = decals.cover(tree, count=60, images=["scale"])
    scene.save_html(folder / "scales.html", title="Scales", resolution=64)
    for name, number in GALLERY.items():
        panel = import_module(f"decals.apps.gallery.{name}").panels()[number]
        decals.save_html(panel.scene, folder / f"{name}.html", title=name.title(), contact=panel.contact)
