"""Our picture into VTK's frame: colour and depth with one triangle."""

from typing import Any

import moderngl

from decals.render.context import Context
from decals.render.targets import Targets
from decals.render.tile import set_uniform
from implicit_decals.shaders import compose

BLEND, DEPTH_TEST, CULL_FACE = 0x0BE2, 0x0B71, 0x0B44
LESS_OR_EQUAL = 0x0203
ONE, SOURCE_ALPHA, REST_OF_ALPHA = 1, 0x0302, 0x0303


class Composite:
    """Draws what the renderer left on the card into the framebuffer that VTK has bound.

    Edges are blended by how much of their pixel the objects cover, so opaque actors should be there before.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def draw(self, window: Any, viewport: tuple[int, int, int, int], targets: Targets, samples: int) -> None:
        """Fill a viewport; ``samples`` texels a pixel along each axis, or 0 for any size, magnified."""
        x, y, width, height = viewport
        array, state = self._array(samples), window.GetState()
        state.Push()
        window.GetShaderCache().ReleaseCurrentShader()
        state.vtkglEnable(DEPTH_TEST)
        state.vtkglDepthFunc(LESS_OR_EQUAL)
        state.vtkglDepthMask(1)
        state.vtkglDisable(CULL_FACE)
        state.vtkglEnable(BLEND)
        state.vtkglBlendFuncSeparate(SOURCE_ALPHA, REST_OF_ALPHA, ONE, REST_OF_ALPHA)
        textures: dict[str, moderngl.Texture] = {
            "light": targets.light_pass.light,
            "depth": targets.gbuffer.depth,
        }
        for unit, (name, texture) in enumerate(textures.items()):
            texture.use(unit)
            set_uniform(array.program, name, unit)
        set_uniform(array.program, "corner", (float(x), float(y)))
        set_uniform(array.program, "size", (float(width), float(height)))
        array.render(vertices=3)
        state.ResetGLActiveTexture()
        state.Pop()

    def _array(self, samples: int) -> moderngl.VertexArray:
        """Give what draws with so many samples: a program for each number of them."""
        if samples not in self._arrays:
            fragment = compose("composite.frag", defines={"SAMPLES": samples})
            program = self._context.program(compose("screen.vert"), fragment)
            self._arrays[samples] = self._context.gl.vertex_array(program, [])
        return self._arrays[samples]

    def release(self) -> None:
        """Give the memory back."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
