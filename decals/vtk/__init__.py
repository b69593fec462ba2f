"""Decals in pyvista: ``plotter.decals``.

pyvista finds the installed component by itself. Importing this package registers it as well.
"""

from decals.vtk.component import DecalsComponent, show
from decals.vtk.lights import Lights
from decals.vtk.picking import PickResult
from decals.vtk.subplot import SubplotRenderer

__all__ = ["DecalsComponent", "Lights", "PickResult", "SubplotRenderer", "show"]
