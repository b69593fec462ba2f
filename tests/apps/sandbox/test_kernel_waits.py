"""No input of a page waits for kernels: threads compile them, whatever the page asks for first."""

from typing import Any

import pytest

import decals
from blobtree import Point
from decals.apps.first_inputs import load_first_kernels
from decals.apps.lab.lesson import LESSONS, load_lessons
from decals.editing import EditSession, ReplaceScene, ScaleDecals, pick
from decals.editing.queries import outlines
from decals.index.editor import DecalEditor
from decals.scenes.objects import TreeObject
from decals.window import EditWindow
from tests.apps.sandbox.browsers import Connect, serve, until
from tests.apps.sandbox.kernel_waits import kernel_waits
from tests.decals.editing.scenes import scene
from tests.decals.window.driver import Driver

pytest.importorskip("trame_vtk")

STEPS = next(i for i, lesson in enumerate(load_lessons(LESSONS)) if lesson.settings.steps)
"""The lesson on scattering."""


def test_first_clicks_and_edits_load_no_kernels_after_those_that_were_loaded_ahead() -> None:
    with kernel_waits() as waits:
        load_first_kernels()
        waits.noting = True
        session = EditSession(decals.cover(Point((0.2, 0, 0), radius=1.2), count=20, images=["eye"]))
        found = pick(session.document, (0, 0, 9), (0, 0, -1))
        assert found is not None
        assert len(outlines(session.document, [found.owner]))
        session.do(ScaleDecals([found.owner], 0.5))
    assert waits.places == []


def test_changes_of_decals_load_no_kernels_after_those_that_were_loaded_ahead() -> None:
    with kernel_waits() as waits:
        editor = DecalEditor(scene().decals)
        editor.load_kernels()
        waits.noting = True
        editor.delete([3])
        editor.assign([3], editor.take([5]))
        assert editor.version > 0
    assert waits.places == []


def test_a_scene_whose_surfaces_are_not_known_replaces_another_in_the_background() -> None:
    ball = TreeObject("ball", Point((0, 0, 0), radius=1.0))
    command = ReplaceScene(decals.Scene(objects=(ball,), camera=decals.Camera((0, 0, 8))))
    assert command.long
    assert ball.bounds[1][0] > 0.9
    assert not command.long


def test_no_input_waits_for_kernels(vtk_display: None) -> None:
    with kernel_waits() as waits:

        async def check(window: EditWindow, page: Any, connect: Connect) -> None:
            sandbox, lab = page.sandbox, page.lab
            browser = await connect()
            waits.noting = True

            async def do(event: Any, *arguments: Any) -> None:
                await browser.trigger(event, *arguments)
                await until(lambda: not window.background.busy)

            await do(sandbox.select, "layer 0")
            await do(sandbox.perform, "delete")  # all decals, which a thread deletes from another index
            assert not len(window.document.decals)
            await do(sandbox.perform, "undo")
            await do(sandbox.add, "Torus")
            await do(sandbox.scatter)
            await until(lambda: any(Driver(window).visible()))
            number, at = next(Driver(window).visible())
            window.actions.state.selection = (number,)
            window.redraw(whole=True)
            await until(lambda: window.overlay.lines.n_points)  # they follow once a thread has the kernels
            for action, x in (("down", 0), ("move", 3), ("move", 6), ("up", 6)):
                await browser.mouse((at[0] + x, at[1]), action=action, down=action != "up")
            await until(lambda: not window.background.busy)
            await do(sandbox.perform, "delete")
            assert number not in window.document.decals.numbers
            await do(sandbox.open_lesson, STEPS)
            await do("guess", 3)
            sliders = [slider.path for slider in lab.lesson.settings.sliders]
            await browser.trigger(page._set_value, sliders.index("step"), 3)
            await until(lambda: lab._step == 3)
            waits.noting = False
            await browser.close()

        serve(check, lessons=True)
    assert waits.places == []
