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

from blobtree import Point
from decals import scatter
from decals.errors import InvalidScene
from decals.vtk import PickResult
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import shot
from tests.decals.vtk.test_composition import BALL, lying_behind, place


def filled(plotter: Factory, *, ours: bool) -> tuple[Plotter, pv.Actor]:
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


def click(pl: Plotter, x: int, y: int, *, left: bool = False) -> None:
    """Press and release a button at a pixel."""
    interactor = pl.iren.interactor
    interactor.SetEventInformation(x, y, 0, 0, "\0", 0, None)
    for event in ("ButtonPressEvent", "ButtonReleaseEvent"):
        interactor.InvokeEvent(("Left" if left else "Right") + event)


@pytest.mark.slow_cases("right")
@pytest.mark.parametrize("left", [False, True], ids=["right", "left"])
def test_a_click_reports_object_decal_and_position(plotter: Factory, left: bool) -> None:
    pl, _ = filled(plotter, ours=True)
    pl.decals.add(scatter([BALL.surface], count=20), images=["scale"])
    picks: list[PickResult] = []
    pl.decals.enable_picking(lambda _pick: pytest.fail("this function was replaced"))
    pl.decals.enable_picking(picks.append, left_clicking=left)
    shot(pl)
    ours = lying_behind(pl.decals.subplot)
    click(pl, 80, 60, left=left)
    (pick,) = picks
    assert (pick.object_id, pick.owner) == (ours.object_id[59, 80], ours.owner[59, 80])
    assert pick.owner >= 0
    np.testing.assert_allclose(pick.position, ours.position[59, 80], atol=1e-4)
    click(pl, 80, 60, left=not left)
    click(pl, 1, 118, left=left)
    assert len(picks) == 1
    pl.decals.disable_picking()
    click(pl, 80, 60, left=left)
    assert len(picks) == 1


def test_a_click_picks_in_the_subplot_under_the_cursor(plotter: Factory) -> None:
    pl = plotter(shape=(1, 2))
    for column, radius in ((0, 1.0), (1, 0.5)):
        pl.subplot(0, column)
        pl.decals.add_implicit(Point((0, 0, 0), radius=radius))
        pl.camera_position = [(0, 0, 6), (0, 0, 0), (0, 1, 0)]
    picks: list[PickResult] = []
    pl.decals.enable_picking(picks.append)
    shot(pl)
    for x in (40, 120):
        click(pl, x, 60)
    heights = [float(pick.position[2]) for pick in picks]
    np.testing.assert_allclose(heights, [1.0, 0.5], atol=0.01)


def test_pyvistas_pickers_warn_that_they_miss_objects(plotter: Factory) -> None:
    for early in (True, False):
        pl = plotter()
        pl.add_mesh(pv.Sphere())
        if early:
            pl.enable_mesh_picking(show_message=False)
        pl.decals.add_implicit(BALL)
        if not early:
            pl.enable_point_picking(show_message=False)
        with pytest.warns(UserWarning, match=r"plotter\.decals\.enable_picking"):
            shot(pl)
        shot(pl)  # only once


def test_pyvistas_pickers_work_on_actors_with_decals_without_a_warning(plotter: Factory) -> None:
    pl = plotter()
    actor = pl.add_mesh(pv.Sphere())
    pl.decals.add(scatter([BALL.surface], count=20), images=["scale"])
    pl.decals.apply(actor)
    pl.enable_mesh_picking(show_message=False)
    shot(pl)


def test_what_is_no_callback_is_refused(plotter: Factory) -> None:
    pl = plotter()
    with pytest.raises(InvalidScene, match="callback: expected a function of a PickResult, got None"):
        pl.decals.enable_picking(None)
    with pytest.raises(InvalidScene, match="left_clicking: expected"):
        pl.decals.enable_picking(print, left_clicking="yes")
