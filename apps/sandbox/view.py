"""The view of the page: pictures of a plotter, each sent once, as soon as it is drawn."""

import asyncio
from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np
import pyvista as pv
from PIL import Image, ImageOps
from trame_pyvista.widgets import PyVistaRemoteView
from trame_vtk.modules.vtk.protocols import vtkWebPublishImageDelivery
from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

from blobtree._typing import UInt8Array
from decals.window import EditWindow
from decals.window.event_bindings import running_loop
from decals.window.frames import FrameState

QUALITY, COARSE_QUALITY = 92, 75
"""JPEG quality of a picture at rest, and of one while something moves."""

MAX_PIXELS = 1 << 25
"""Pixels of a picture that is sent, at most."""

MAX_DRAWN, MAX_DRAWN_BY_PROCESSORS = 1 << 24, 1 << 22
"""Pixels that are drawn at most, by a card and by processors; larger views show them enlarged. A pixel takes
290 bytes, of the program's own memory where processors draw."""

FRAME_SECONDS = 0.045
"""Duration of a frame while something moves, at most: a page shows it after about as long again."""

CAMERA_SECONDS = 1.0 / 30.0
"""Time between two looks at a camera that may move."""

PENDING_SECONDS = 0.01
"""Time between two looks at browsers that are not ready for another picture."""


class StreamedView(PyVistaRemoteView):  # type: ignore[misc]  # trame is not typed
    """Draws the newest state only, once all messages that wait are handled, and encodes it in a thread.

    trame's own view draws a frame for every message, and waits half a second for a picture that is still
    being encoded.

    Parameters
    ----------
    window
        The edited window.
    before_frame
        Called before each frame.
    behind
        Returns True while no browser is ready for another picture.
    sizes
        Returns the size of the view of each browser that shares the page; empty if none does.
    options
        Options of the element.
    """

    def __init__(
        self,
        window: EditWindow,
        before_frame: Callable[[], None],
        behind: Callable[[], bool] = lambda: False,
        sizes: Callable[[], dict[str, tuple[int, int]]] = dict,
        **options: Any,
    ) -> None:
        self._window, self._before_frame, self._behind = window, before_frame, behind
        self._sizes = sizes
        self._outdated, self._sent = False, -1
        self._task: asyncio.Task[None] | None = None
        self._animation: asyncio.Task[None] | None = None
        self._delivery: Any = None
        self._camera_time = 0
        self._drawn_size: tuple[int, ...] = ()
        super().__init__(window.plotter, **options)
        self.server.add_protocol_to_configure(self._take_over)
        window.frames.budget.target = FRAME_SECONDS

    def _take_over(self, protocol: Any) -> None:
        """Draw here what trame's own delivery would draw."""
        for part in protocol.getLinkProtocols():
            if isinstance(part, vtkWebPublishImageDelivery):
                self._delivery = part
                part.push_render, part.animate = self._push, self._animate

    def _animate(self) -> None:
        """Look for a moved camera while a button is down; trame would start one more loop with each press."""
        loop = running_loop()
        if loop is not None and self._animation is None:
            self._animation = loop.create_task(self._follow_camera(), name="camera of the sandbox")

    async def _follow_camera(self) -> None:
        try:
            while self._delivery.views_in_animations:
                self._push("", animated=True)
                await asyncio.sleep(CAMERA_SECONDS)
        finally:
            self._animation = None

    def _push(self, _view: str, animated: bool = False, _stale: int = 0) -> None:
        """Draw after input of the view; while a button is down, trame asks for frames all the time."""
        camera_time = self._window.plotter.renderer.camera.GetMTime()
        if not animated or camera_time != self._camera_time:
            self._camera_time = camera_time
            self.update()

    def update(self, **_: Any) -> None:
        """Send a new picture to the page soon."""
        self._outdated = True
        loop = running_loop()
        if self._delivery is not None and self._task is None and loop is not None:
            self._task = loop.create_task(self._send(), name="pictures of the sandbox")

    async def _send(self) -> None:
        """Send pictures until the last one is up to date."""
        try:
            while self._outdated:
                await asyncio.sleep(0)  # messages that wait are handled first
                while self._behind():
                    await asyncio.sleep(PENDING_SECONDS)
                self._before_frame()
                self._outdated = False
                if not self._window.plotter.render_window:
                    return
                pixels = self._draw()
                before = self._window.subplot.warming_up  # the frame before stays
                shown = self._sent if before else self._window.session.changes
                coarse = self._window.frames.state is FrameState.COARSE
                quality, sizes = COARSE_QUALITY if coarse else QUALITY, self._sizes()
                own, drawn = self._size(), (pixels.shape[1], pixels.shape[0])
                own = own if own[0] * own[1] <= MAX_PIXELS else drawn
                images = await asyncio.to_thread(_encoded, pixels, quality, {own, *sizes.values()})
                if not sizes:
                    self._publish(images[own], own)
                for client, size in sizes.items():
                    if size in images:  # else the view is hidden
                        self._publish(images[size], size, client_id=client)
                self._sent = shown
        finally:
            self._task = None

    def _draw(self) -> UInt8Array:
        """Draw a frame at the size of the page's view, and return its pixels."""
        target: Any = self._window.plotter.render_window
        target.GetInteractor().EnableRenderOff()
        target.SetSize(self._drawable_size())
        target.Render()
        width, height = self._drawn_size = target.GetSize()
        picture = vtkWindowToImageFilter(input=target, read_front_buffer=False, should_rerender=False)
        picture.Update()
        pixels: UInt8Array = pv.convert_array(picture.GetOutput().GetPointData().GetScalars())
        return np.ascontiguousarray(pixels.reshape(height, width, 3)[::-1])

    def shows(self, changes: int) -> bool:
        """Return True once a picture was sent with so many changes of the session, or more."""
        return self._sent >= changes

    def fit(self) -> None:
        """Limit the size of the window, which trame has set to that of the page's view."""
        if self._delivery is not None and self._window.plotter.render_window:
            self._window.plotter.render_window.SetSize(self._drawable_size())

    def _drawable_size(self) -> tuple[int, int]:
        """Return the size of the page's view, or a smaller one with its proportions."""
        width, height = self._size()
        software = self._window.subplot.renderer.context.software
        most = MAX_DRAWN_BY_PROCESSORS if software else MAX_DRAWN
        share = min(1.0, (most / (width * height)) ** 0.5)
        drawn = min(max(int(share * width), 1), most)
        return drawn, min(max(int(share * height), 1), most // drawn)

    def _size(self) -> tuple[int, int]:
        """Return the size of the page's view in pixels; that of the window if the view is hidden."""
        views = {} if self._delivery is None else self._delivery.tracking_views
        tracked: dict[str, Any] = next(iter(views.values()), {})
        sides = [int(side * tracked.get("ratio", 1) + 0.5) for side in tracked.get("originalSize", ())]
        target: Any = self._window.plotter.render_window
        width, height = sides if sides and min(sides) > 0 else target.GetSize()
        return width, height

    def follow_size(self) -> None:
        """Send a new picture if the last one had another size than the page's view: trame asks for none.

        The window may have the new size already: trame sets it with the quality.
        """
        drawn = self._drawn_size and self._window.plotter.render_window
        if drawn and self._drawable_size() != self._drawn_size:
            self.update()

    def _publish(self, image: bytes, size: tuple[int, int], **to: str) -> None:
        for view in self._delivery.tracking_views:
            message = {
                "id": view,
                "image": self._delivery.addAttachment(image),
                "format": "jpeg",
                "size": list(size),
                "memsize": len(image),
                "workTime": 0,
                "stale": False,
            }
            self._delivery.publish("viewport.image.push.subscription", message, **to)


def _encoded(pixels: UInt8Array, quality: int, sizes: set[tuple[int, int]]) -> dict[tuple[int, int], bytes]:
    """Return a picture as JPEG in each size, with bars where the proportions differ by more than a pixel.

    Browsers show no picture of another size than that of their view.
    """
    picture = Image.fromarray(pixels)
    files = {size: BytesIO() for size in sizes if 0 < size[0] * size[1] <= MAX_PIXELS}
    for size, file in files.items():
        alike = abs(size[0] * picture.height - size[1] * picture.width) <= max(size)
        fitted = picture.resize(size) if alike else ImageOps.pad(picture, size, color="white")
        fitted.save(file, "JPEG", quality=quality)
    return {size: file.getvalue() for size, file in files.items()}
