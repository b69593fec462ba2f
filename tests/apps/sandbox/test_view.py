"""The pictures that a page gets, without a browser."""

import asyncio
from io import BytesIO
from typing import Any

import pytest
from PIL import Image

import decals
from decals.window import EditWindow
from tests.apps.sandbox.test_sandbox import TREE


class Protocol:
    """A connection that keeps what it would send."""

    def __init__(self, *parts: Any) -> None:
        self.parts = parts

    def getLinkProtocols(self) -> tuple[Any, ...]:
        return self.parts


def test_many_changes_are_one_picture_of_the_newest_state(vtk_display: None) -> None:
    pytest.importorskip("trame_vtk")
    from trame.app import get_server
    from trame.ui.vuetify3 import VAppLayout
    from trame_vtk.modules.vtk.protocols import vtkWebPublishImageDelivery

    from decals.apps.sandbox.view import StreamedView

    sent: list[dict[str, Any]] = []
    steps: list[int] = []
    with EditWindow(decals.cover(TREE, count=20, images=["tile"]), off_screen=True, size=(80, 60)) as window:
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

        asyncio.run(changes())
    assert steps == [0, 1]
    pictures = [Image.open(BytesIO(message["image"])) for message in sent]
    assert [picture.size for picture in pictures] == [(100, 70)] * 2
    assert [message["id"] for message in sent] == ["7", "7"]
    assert pictures[0].tobytes() != pictures[1].tobytes()
