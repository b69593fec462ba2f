"""VTK's own pickers work as if we were not there; depth under the mouse is ours too."""

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkRenderingCore import (
    vtkCellPicker,
    vtkHardwareSelector,
    vtkPropPicker,
    vtkWorldPointPicker,
)

from decals.scattering.scatter import scatter
from tests.decals.vtk.conftest import Factory
from tests.decals.vtk.scenes import shot
from tests.decals.vtk.test_composition import BALL, lying_behind, place


def filled(plotter: Factory, *, ours: bool) -> tuple[pv.Plotter, pv.Actor]:
    pl = plotter()
    pl.disable_anti_aliasing()
    actor = pl.add_mesh(pv.Sphere(radius=0.5, center=(0, -1.4, -0.7)), color="tan")
    pl.add_mesh(pv.Plane(center=(-2, 0, 0), direction=(1, 0, 0), i_size=9, j_size=9))
    if ours:
        pl.decals.add_implicit(BALL)
    place(pl)
    shot(pl)
    return pl, actor


@pytest.mark.parametrize("applied", [False, True])
def test_hardware_selection_finds_actors_behind_us_and_under_decals(plotter: Factory, applied: bool) -> None:
    found = []
    for ours in (False, True):
        pl, actor = filled(plotter, ours=ours)
        if ours and applied:
            pl.decals.add(scatter([BALL.surface], count=20), images=["scale"])
            pl.decals.apply(actor)
            shot(pl)
        selector = vtkHardwareSelector()
        selector.SetRenderer(pl.renderer)
        selector.SetArea(0, 0, 159, 119)
        selection = selector.Select()
        nodes = [selection.GetNode(i) for i in range(selection.GetNumberOfNodes())]
        cells = {
            node.GetProperties().Get(node.PROP()) is actor: node.GetSelectionList().GetNumberOfTuples()
            for node in nodes
        }
        found.append(cells)
        np.testing.assert_array_equal(
            pl.screenshot(None, return_img=True), pl.screenshot(None, return_img=True)
        )
    assert found[0] == found[1]
    assert found[0][True] > 50


def test_software_pickers_never_pick_us(plotter: Factory) -> None:
    for picker in (vtkPropPicker(), vtkCellPicker()):
        places = []
        for ours in (False, True):
            pl, actor = filled(plotter, ours=ours)
            picked = [
                (bool(picker.Pick(x, y, 0, pl.renderer)), picker.GetActor() is actor)
                for x in range(0, 160, 16)
                for y in range(0, 120, 16)
            ]
            places.append(picked)
        assert places[0] == places[1]
        assert any(is_actor for _, is_actor in places[0])


def test_a_world_point_lies_on_our_surface(plotter: Factory) -> None:
    pl, _ = filled(plotter, ours=True)
    ours = lying_behind(pl.decals.subplot)
    assert ours.object_id[59, 80] == 0
    picker = vtkWorldPointPicker()
    picker.Pick(80, 60, 0, pl.renderer)
    np.testing.assert_allclose(picker.GetPickPosition(), ours.position[59, 80], atol=0.03)
    hit = pl.decals.subplot.at(80, 60)
    assert hit is not None
    z = pl.renderer.GetZ(80, 60)
    assert abs(z - hit.depth) < 1e-4
