"""The rest pose behind every pixel of posed meshes and of trees moved by heights, beside the G-buffer."""

import moderngl

from decals.rendering.context import Context
from decals.rendering.gbuffer import GBuffer
from decals.rendering.viewpoint import WHOLE, Part, Rectangle


class RestBuffer:
    """Place and normal in the rest pose, and two steps to the next pixels: see ``shaders/rest.frag``.

    It shares the depth of a G-buffer. Where objects that are not rasterised hide a posed mesh, the numbers of
    objects in the two buffers differ.

    Parameters
    ----------
    context
        Where to make the textures.
    gbuffer
        The G-buffer, already drawn when this is.
    """

    def __init__(self, context: Context, gbuffer: GBuffer) -> None:
        names = "r_position", "r_right", "r_up"
        self.textures = {name: context.texture(gbuffer.size, "f4") for name in names}
        for texture in self.textures.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        rest = list(self.textures.values())
        self._framebuffer = context.gl.framebuffer(rest, gbuffer.depth)
        surface = [gbuffer.position, gbuffer.normal, gbuffer.color]
        self._with_surface = context.gl.framebuffer([*surface, *rest], gbuffer.depth)
        self._gl, self._gbuffer = context.gl, gbuffer

    def use(self, width: int, height: int, part: Part = WHOLE) -> None:
        """Restrict the next draws to these rows of the lower left part of this size."""
        self._gbuffer.bind(self._framebuffer, width, height, part)
        self._gl.depth_func = "<="

    def use_with_surface(self, width: int, height: int, part: Part = WHOLE) -> None:
        """Do the same for draws into the G-buffer and this buffer at once; see ``shaders/offset.frag``."""
        self._gbuffer.bind(self._with_surface, width, height, part)

    def bind_images(self, first_unit: int) -> None:
        """Bind the textures to image units, for compute shaders that write them."""
        for unit, texture in enumerate(self.textures.values(), first_unit):
            texture.bind_to_image(unit, read=False, write=True)

    def clear(self, width: int, height: int, part: Part = WHOLE) -> None:
        """Clear these rows of the lower left part of this size; the depth stays."""
        rows = Rectangle(0, 0, width, height).rows(part)
        if self._gbuffer.clear_by_compute(list(self.textures.values()), rows):
            return
        self.use(width, height, part)
        self._framebuffer.depth_mask = False
        self._framebuffer.clear(0.0, 0.0, 0.0, 0.0)
        self._framebuffer.depth_mask = True

    def release(self) -> None:
        """Release the memory."""
        self._framebuffer.release()
        self._with_surface.release()
        for texture in self.textures.values():
            texture.release()
