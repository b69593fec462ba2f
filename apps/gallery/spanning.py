"""Figure 5 of the paper: a single decal covers different models, here a mesh and an implicit surface."""

from collections.abc import Sequence
from dataclasses import replace

from ..models.spanning import spanning
from .panels import Panel, main


def panels() -> Sequence[Panel]:
    """Show the demo's box and blob under one eye."""
    scene = spanning()
    return (Panel(scene.replace(camera=replace(scene.camera, fov=36.0))),)


if __name__ == "__main__":
    main(panels)
