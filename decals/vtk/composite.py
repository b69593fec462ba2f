"""Composite: a picture with colour and depth into VTK's frame."""

from typing import Any

import moderngl

from decals.rendering.context import Context
from decals.rendering.targets import Targets
from decals.rendering.tiles import set_uniform
from decals.shaders import compose

BLEND, DEPTH_TEST, CULL_FACE = 0x0BE2, 0x0B71, 0x0B44
LESS_OR_EQUAL = 0x0203
ONE, SOURCE_ALPHA, REST_OF_ALPHA = 1, 0x0302, 0x0303


class Composite:
    """Draws the renderer's targets into the framebuffer that VTK has bound.

    Edges are blended by their coverage, so opaque actors must be drawn before.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def draw(self, window: Any, viewport: tuple[int, int, int, int], targets: Targets, samples: int) -> None:
        """Fill a viewport.

        Parameters
        ----------
        window
            VTK's window.
        viewport
            Lower left corner and size, in pixels.
        targets
            Targets with the picture.
        samples
            Texels per pixel along each axis; 0 for a picture of any size that is magnified.
        """
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
        """Return the vertex array, and with it the program, for a number of samples."""
        if samples not in self._arrays:
            fragment = compose("composite.frag", defines={"SAMPLES": samples})
            program = self._context.program(compose("screen.vert"), fragment)
            self._arrays[samples] = self._context.gl.vertex_array(program, [])
        return self._arrays[samples]

    def release(self) -> None:
        """Release all resources."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
