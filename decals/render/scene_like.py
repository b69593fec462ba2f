"""What is read of a scene; `decals.scenes.scene.Scene` is one.

Its decals may be a `DecalEditor`: then what was edited since the last picture alone goes to the card.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from decals.grid.editor import DecalEditor
from decals.model import Decals
from decals.scenes.camera import Camera


class ImageLike(Protocol):
    """An image of a scene: straight RGBA, row 0 at the top."""

    @property
    def pixels(self) -> NDArray[np.uint8]: ...  # noqa: D102


class SceneLike(Protocol):
    """What is read of a scene (`decals.scenes.scene.Scene`)."""

    @property
    def objects(self) -> Sequence[object]: ...  # noqa: D102
    @property
    def decals(self) -> Decals | DecalEditor: ...  # noqa: D102
    @property
    def images(self) -> Sequence[ImageLike]: ...  # noqa: D102
    @property
    def camera(self) -> Camera: ...  # noqa: D102
