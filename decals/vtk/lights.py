"""VTK's lights, as our renderer takes them."""

from enum import Enum
from typing import Any

import numpy as np

from decals.render.lamps import MOST_LAMPS, Lamp, Lamps
from decals.scenes.viewpoint import Floats

TOO_MANY = f"more than {MOST_LAMPS} lights: what decals draws is lit by the first {MOST_LAMPS} alone"


class Lights(Enum):
    """Who lights what a stage shows."""

    SCENE = "scene"
    """The scene's own studio light, which stays with the camera: the same pixels as everywhere else."""
    VTK = "vtk"
    """The plotter's lights, those that light its other actors."""


def vtk_lamps(renderer: Any, place: Floats) -> Lamps:
    """Give the lights of a vtkRenderer that are switched on, where they shine in its last frame.

    Parameters
    ----------
    renderer
        A vtkRenderer; lights that go with the camera are where it last put them.
    place
        The scene's coordinates to the world's, ``float64[4, 4]``.
    """
    lights = [light for light in renderer.GetLights() if light.GetSwitch()]
    return Lamps(tuple(map(_lamp, lights[:MOST_LAMPS])), tuple(place.ravel().tolist()))


def too_many_lights(renderer: Any) -> bool:
    """Whether a vtkRenderer has more lights than ours can take."""
    return sum(bool(light.GetSwitch()) for light in renderer.GetLights()) > MOST_LAMPS


def _lamp(light: Any) -> Lamp:
    position = np.array(light.GetTransformedPosition())
    way = np.array(light.GetTransformedFocalPoint()) - position
    away = float(np.linalg.norm(way)) or 1.0
    red, green, blue = (np.array(light.GetDiffuseColor()) * light.GetIntensity()).tolist()
    x, y, z = (way / away).tolist()
    if not light.GetPositional():
        return Lamp((red, green, blue), (x, y, z))
    return Lamp(
        (red, green, blue),
        (x, y, z),
        tuple(position.tolist()),
        tuple(light.GetAttenuationValues()),
        light.GetConeAngle(),
        light.GetExponent(),
    )
