"""The window counts the places that an edit has bared, and says how to fill them."""

import numpy as np

import decals
from blobtree import Point
from decals.editing import MovePrimitive
from decals.window import EditWindow


def test_the_line_at_the_bottom_counts_what_a_pull_has_bared(vtk_display: None) -> None:
    tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0.4, 0), radius=0.6)
    scene = decals.cover(tree, count=40, images=["eye"])
    with EditWindow(scene, off_screen=True, size=(120, 90)) as window:
        window.show()

        def rest() -> str:
            window.tick()
            while window.background.busy or window.actions.bare.busy:
                assert window.busy  # an asyncio loop goes on with ticks
                window.tick()
            return window._status()

        assert "bare" not in rest()
        window.session.do(MovePrimitive(0, (1,), (0.7, 0.3, 0)))
        window.redraw(whole=True)
        status = rest()
        assert window.actions.bare.places > 0
        assert f"Shift+G: fill bare places: {window.actions.bare.places}" in status
        window.actions.perform("fill", lambda: None)
        assert "bare places:" not in rest()
        assert window.session.labels[-1] == "fill bare places"
        assert decals.measure(window.document.scene).coverage > 0.9999
        assert np.isfinite(window.plotter.screenshot(None, return_img=True)).all()
