"""Effects of the decal pass: what it needs to know of textures that extend it."""

from typing import Any, Protocol

import moderngl

from decals.rendering.pixel_pass import Program


class DecalTexture(Protocol):
    """A texture that decals read beside their images."""

    @property
    def texture(self) -> moderngl.Texture | moderngl.TextureArray: ...  # noqa: D102


class ReliefEffect(DecalTexture, Protocol):
    """Heights of the images of decals."""

    @property
    def reach(self) -> float:
        """Greatest distance, in model units, by which the surface moves in or out."""
        ...

    def use(self, program: Program, lights: Any) -> None:
        """Set the uniforms of a program but for the samplers; the first of the lights casts shadows."""
        ...
