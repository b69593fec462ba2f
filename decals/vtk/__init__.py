"""Decals inside pyvista: ``plotter.decals``.

Once the package is installed pyvista finds the component by itself; importing this package registers it too.
"""

from decals.vtk.component import Component
from decals.vtk.lights import Lights
from decals.vtk.picking import Hit
from decals.vtk.stage import Stage
from decals.vtk.viewer import show

__all__ = ["Component", "Hit", "Lights", "Stage", "show"]
