"""Decals in pyvista: ``plotter.decals``.

pyvista finds the installed component by itself. Importing this package registers it as well.
"""

from decals.vtk.adapters import Lights
from decals.vtk.component import DecalsComponent, show
from decals.vtk.subplot import PickResult, SubplotRenderer

__all__ = ["DecalsComponent", "Lights", "PickResult", "SubplotRenderer", "show"]
