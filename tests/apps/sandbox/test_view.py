"""The pictures that a page gets, without a browser."""

import asyncio
import html
import math
import re
from functools import partial
from io import BytesIO
from typing import Any

import pytest
from PIL import Image

import decals
from decals.editing import KEYS
from decals.editing.brush_settings import Brush
from decals.editing.commands import AddImage
from decals.editing.key_bindings import format_gestures
from decals.editing.view_actions import SIDE_KEYS
from decals.vtk.subplot import SubplotRenderer
from decals.window import EditWindow
from tests.apps.sandbox.browsers import Connect, serve, until
from tests.apps.sandbox.test_sandbox import TREE, covered


class Protocol:
    """A connection that keeps what it would send."""

    def __init__(self, *parts: Any) -> None:
        self.parts = parts

    def getLinkProtocols(self) -> tuple[Any, ...]:
        return self.parts


def test_each_action_shows_its_key_and_is_in_the_menu(vtk_display: None) -> None:
    pytest.importorskip("trame_vtk")
    from trame.app import get_server

    from decals.apps.sandbox.page import TOOLBAR, Page

    server = get_server("keys", client_type="vue3")
    with EditWindow(decals.cover(TREE, count=0, images=["tile"]), off_screen=True, size=(80, 60)) as window:
        Page(server, window)
    page = str(server.state.trame__template_main)
    bindings = {binding.action: binding for binding in KEYS.bindings if binding.action != "camera"}
    menu = page[page.index("Actions") :]
    by_pointer = {"select", "select_further", "select_also", "toggle", "move", "close"}
    assert all(html.escape(bindings[name].summary) in menu for name in bindings.keys() - by_pointer)
    assert all(format_gestures(binding) for binding in bindings.values())
    buttons = [
        *TOOLBAR,
        *(f"brush_{brush}" for brush in Brush),
        "frame",
        *(f"view_{side}" for side in SIDE_KEYS),
    ]
    for name in buttons:
        assert f"{bindings[name].summary} ({format_gestures(bindings[name])})" in page
    icons = re.findall(r"<VBtn[^>]* icon=[^>]*>", page)
    assert len(icons) > 20
    assert all("title=" in icon and "aria-label=" in icon for icon in icons)


def test_many_changes_are_one_picture_of_the_newest_state(
    vtk_display: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("trame_vtk")
    from trame.app import get_server
    from trame.ui.vuetify3 import VAppLayout
    from trame_vtk.modules.vtk.protocols import vtkWebPublishImageDelivery

    from decals.apps.sandbox.view import StreamedView

    sent: list[dict[str, Any]] = []
    steps: list[int] = []
    with EditWindow(covered(), off_screen=True, size=(80, 60)) as window:
        window.show()
        with VAppLayout(get_server("view", client_type="vue3")):
            view = StreamedView(window, lambda: steps.append(len(sent)))
        delivery = vtkWebPublishImageDelivery(decode=False)
        delivery.publish = lambda _, message: sent.append(message)
        delivery.addAttachment = lambda content: content
        delivery.tracking_views["7"] = {"originalSize": [100, 70], "ratio": 1}
        view._take_over(Protocol(object(), delivery))
        view.update()  # without a loop, nothing is sent
        assert sent == []
        assert not view.shows(0)

        async def changes() -> None:
            for _ in range(5):
                view.update()
            delivery.push_render("7")
            while not sent:
                await asyncio.sleep(0.01)
            window.plotter.camera.azimuth = 20
            delivery.push_render("7", True)  # while a button is down, frames follow the camera
            while len(sent) < 2:
                await asyncio.sleep(0.01)
            delivery.push_render("7", True)
            await asyncio.sleep(0.05)
            assert len(sent) == 2
            # With the quality, trame sets the size of the window too, and draws nothing.
            delivery.tracking_views["7"]["originalSize"] = [90.6, 70]
            window.plotter.render_window.SetSize(91, 70)
            for _ in range(2):
                view.follow_size()
                while len(sent) < 3:
                    await asyncio.sleep(0.01)
            await asyncio.sleep(0.05)
            assert view.shows(0)
            first = window.session.changes
            window.session.do(AddImage(decals.DecalImage.load("eye")))
            for warming in (True, False):
                monkeypatch.setattr(SubplotRenderer, "warming_up", warming)  # the picture before stays
                view.update()
                await until(lambda: view._task is None)
                assert view.shows(first)
                assert view.shows(window.session.changes) != warming

        asyncio.run(changes())
    assert steps == [0, 1, 2, 3, 4]
    pictures = [Image.open(BytesIO(message["image"])) for message in sent[:3]]
    assert [picture.size for picture in pictures] == [(100, 70), (100, 70), (91, 70)]
    assert [message["id"] for message in sent] == ["7"] * 5
    assert pictures[0].tobytes() != pictures[1].tobytes()


def test_views_of_any_size_are_drawn_in_few_pixels(
    vtk_display: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("trame_vtk")
    from decals.apps.sandbox import view as module

    monkeypatch.setattr(module, "MAX_DRAWN_BY_PROCESSORS", 2000)
    monkeypatch.setattr(module, "MAX_DRAWN", 2000)
    monkeypatch.setattr(module, "MAX_PIXELS", 40_000)

    async def check(window: EditWindow, page: Any, connect: Connect) -> None:
        browser, pictures = await connect(), list[dict[str, Any]]()

        def is_last(size: tuple[int, int]) -> bool:
            return bool(pictures) and tuple(pictures[-1]["size"]) == size

        browser._session.register_subscription("viewport.image.push.subscription", pictures.append)
        view = str(page.view._delivery.get_global_id(window.plotter.render_window))
        await browser.call("viewport.image.push.observer.add", view)
        for size, ratio, sent in (
            ((200, 150), 1, (200, 150)),
            ((100, 75), 2, (200, 150)),
            ((16384, 16384), 8, (44, 44)),
            ((16384, 1), 1, (16384, 1)),
            ((30, 20), 1, (30, 20)),
        ):
            await browser.call("viewport.image.push.original.size", view, *size)
            await browser.call("viewport.image.push.quality", view, 85, ratio)
            assert math.prod(window.plotter.window_size) <= 2000
            page.view.update()
            await until(partial(is_last, sent))
            width, height = window.plotter.window_size
            assert width * height <= 2000
            assert abs(width * size[1] - height * size[0]) <= max(size) or min(width, height) == 1
        await browser.close()

    serve(check)
