"""Our contexts and VTK's share one EGL display; VTK ends it with its last window, and begins by ending it.

Whatever else was made on that display is gone then, and draws black without an error. A window that stays
open for as long as the process lives keeps VTK from doing so.
"""

import sys
from typing import Any

_held: list[Any] = []


def hold_display() -> None:
    """Keep VTK from ending the display of contexts that are made from now on.

    Nothing happens where VTK's OpenGL was not imported, or does not go through EGL. Contexts made before VTK
    was imported are not saved by it.
    """
    vtk: Any = sys.modules.get("vtkmodules.vtkRenderingOpenGL2")
    if _held or not hasattr(vtk, "vtkEGLRenderWindow"):
        return
    window = vtk.vtkEGLRenderWindow()
    window.SetSize(1, 1)
    window.OffScreenRenderingOn()
    window.Render()
    _held.append(window)
