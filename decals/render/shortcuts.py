"""One call for one picture."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.render.canvas import Buffers
from decals.render.renderer import Renderer
from decals.render.scene_like import SceneLike


def render(scene: SceneLike, **options: Any) -> NDArray[np.uint8]:
    """Draw one picture in a context made for it; options and result are those of `Renderer.render`."""
    with Renderer() as renderer:
        return renderer.render(scene, **options)


def render_buffers(scene: SceneLike, **options: Any) -> Buffers:
    """Give what lies behind the pixels of one picture; options and result are those of `Renderer.buffers`."""
    with Renderer() as renderer:
        return renderer.buffers(scene, **options)
