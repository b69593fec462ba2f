"""Create an OpenGL context and print its description as JSON.

Run this module in a separate process: a faulty driver can crash it.
"""

import json
import sys
from typing import Any

import moderngl

from blobtree.graphics import require_gl

OLDEST_GL = 210
GLSL_VERSIONS = (460, 450, 440, 430, 420, 410, 400, 330)
SMALLEST_SHADER = "#version {} core\nvoid main() {{ gl_Position = vec4(0.0); }}"


def newest_glsl(gl: moderngl.Context) -> int:
    """Return the newest version of GLSL that compiles (330 for 3.30), or 0 if it is older than 3.30."""
    for version in GLSL_VERSIONS:
        try:
            gl.program(vertex_shader=SMALLEST_SHADER.format(version)).release()
        except moderngl.Error:
            continue
        return version
    return 0


def describe() -> dict[str, str | int]:
    """Describe the best available OpenGL context.

    Returns
    -------
    dict
        ``code`` (330 for OpenGL 3.3), ``glsl`` (330 for GLSL 3.30), ``vendor``, ``renderer`` and ``version``.

    Raises
    ------
    decals.errors.NoGraphics
        The system libraries are missing.
    Exception
        If moderngl cannot create a context.
    """
    require_gl()
    settings: dict[str, Any] = {"backend": "egl"} if sys.platform.startswith("linux") else {}
    try:
        gl = moderngl.create_context(require=330, standalone=True, **settings)
    except Exception:  # glcontext raises nothing more precise
        gl = moderngl.create_context(require=OLDEST_GL, standalone=True, **settings)
    with gl:
        return {
            "code": gl.version_code,
            "glsl": newest_glsl(gl),
            "vendor": gl.info["GL_VENDOR"],
            "renderer": gl.info["GL_RENDERER"],
            "version": gl.info["GL_VERSION"],
        }


if __name__ == "__main__":
    try:
        print(json.dumps(describe()))
    except Exception as error:  # the parent process reads the reason
        sys.exit(str(error))
