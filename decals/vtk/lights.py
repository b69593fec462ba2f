"""Lights of a subplot: the studio light, or VTK's lights converted for the renderer."""

from enum import Enum
from typing import Any

import numpy as np

from blobtree._typing import Float64Array
from decals.rendering.lights import MAX_LIGHTS, Light, Lighting

TOO_MANY = f"more than {MAX_LIGHTS} lights: only the first {MAX_LIGHTS} light the decals and their objects"


class Lights(Enum):
    """Lights of a subplot.

    Examples
    --------
    >>> import pyvista
    >>> from decals.vtk import Lights
    >>> plotter = pyvista.Plotter(off_screen=True)
    >>> plotter.decals.lights = Lights.VTK
    >>> plotter.decals.lights.value
    'vtk'
    >>> plotter.close()
    """

    SCENE = "scene"
    """A studio light that moves with the camera, as in `decals.render`."""
    VTK = "vtk"
    """The plotter's lights."""


def vtk_lamps(renderer: Any, frame: Float64Array) -> Lighting:
    """Return the lights of a vtkRenderer that are switched on, as in its last frame.

    Parameters
    ----------
    renderer
        A vtkRenderer.
    frame
        Matrix from scene to world coordinates, shape (4, 4).
    """
    lights = [light for light in renderer.GetLights() if light.GetSwitch()]
    return Lighting(tuple(map(_lamp, lights[:MAX_LIGHTS])), tuple(frame.ravel().tolist()))


def too_many_lights(renderer: Any) -> bool:
    """Return True if a vtkRenderer has more than MAX_LIGHTS lights."""
    return sum(bool(light.GetSwitch()) for light in renderer.GetLights()) > MAX_LIGHTS


def _lamp(light: Any) -> Light:
    position = np.array(light.GetTransformedPosition())
    way = np.array(light.GetTransformedFocalPoint()) - position
    away = float(np.linalg.norm(way)) or 1.0
    red, green, blue = (np.array(light.GetDiffuseColor()) * light.GetIntensity()).tolist()
    x, y, z = (way / away).tolist()
    if not light.GetPositional():
        return Light((red, green, blue), (x, y, z))
    return Light(
        (red, green, blue),
        (x, y, z),
        tuple(position.tolist()),
        tuple(light.GetAttenuationValues()),
        light.GetConeAngle(),
        light.GetExponent(),
    )
