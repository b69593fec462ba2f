"""Scenes to pictures."""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterator
from functools import partial
from itertools import chain
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from decals.checks import instance, whole
from decals.errors import InvalidPoints, InvalidScene
from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.render.canvas import BufferCanvas, Buffers, Canvas
from decals.render.context import Context
from decals.render.decal_data import DecalData
from decals.render.drawing import Drawing
from decals.render.entry import Entry
from decals.render.lamps import Lamps
from decals.render.modes import Modes
from decals.render.parts import Rectangle
from decals.render.pieces import Ahead, told
from decals.render.preparing import ahead_of_scene
from decals.render.resolve import STUDIO, Background
from decals.render.scene_like import SceneLike
from decals.render.shown import Shown
from decals.render.slots import BUFFERS_SLOT, WHOLE_SLOT, Slots
from decals.render.steps import Order, Plan, Uploaded, plan_of
from decals.render.targets import Size, Targets
from decals.render.textures import ImageArray
from decals.render.tile import MARGIN, MAX_TILE, CameraBuffer, Picture, Tile, largest_tile, tiles
from decals.render.uploads import Uploads
from decals.render.wishes import check_scene, check_size, viewpoint_of
from decals.scenes.viewpoint import Viewpoint


class Renderer:
    """Draws scenes; owns everything that it puts on the graphics card.

    What it uploads for an object, for the decals or for the images stays for the next picture of the same
    ones, and what of a picture is as in the one before is not drawn again. Use it as a context manager, or
    call `release`.

    Parameters
    ----------
    context
        Where to draw; without one, a standalone context that the renderer owns.
    max_tile
        Pictures with more samples than this per axis are drawn in parts.

    Raises
    ------
    NoGraphics
        No context can be made.
    """

    def __init__(self, context: Context | None = None, *, max_tile: int = MAX_TILE) -> None:
        if context is not None:
            instance("context", context, Context, InvalidScene, "Context.standalone makes one")
        whole("max_tile", max_tile, 1, MAX_TILE, InvalidScene)
        self._owned = context is None
        self.context = context or Context.standalone()
        self._max_tile = min(max_tile, self.context.max_texture_size - 2 * MARGIN)
        self._uploads = Uploads(self.context)
        self._targets = Slots(self.context)
        self._made: set[Hashable] = set()
        with self.context.current():
            self._camera = CameraBuffer(self.context)

    def render(
        self,
        scene: SceneLike,
        *,
        size: Size = (800, 600),
        samples: int = 2,
        background: Background = STUDIO,
        mapping: Mapping = Mapping.CORRECTED,
        contact: Contact = Contact.PAPER,
        viewpoint: Viewpoint | None = None,
        lamps: Lamps | None = None,
    ) -> NDArray[np.uint8]:
        """Draw a scene.

        Parameters
        ----------
        scene
            Objects, decals, images and camera.
        size
            Width and height in pixels.
        samples
            Samples per pixel along each axis; 2 means 4 a pixel.
        background
            What is behind the objects.
        mapping
            How images are laid onto curved surface.
        contact
            How contact decals push each other.
        viewpoint
            Where the picture is taken from, if not by the scene's camera.
        lamps
            Lights in place of the studio's.

        Returns
        -------
        uint8[h, w, 4]
            sRGB and alpha, row 0 at the top.

        Raises
        ------
        InvalidScene
            The scene is none, holds an object of unknown kind, or another argument is not of its kind.
        """
        check_size(size, samples)
        instance("background", background, Background, InvalidScene, "such as decals.render.STUDIO")
        canvas = Canvas(size, 4, np.uint8)
        for tile, targets in self._tiles(scene, viewpoint, size, samples, Modes(mapping, contact, lamps)):
            light = targets.light_pass.light
            canvas.place(targets.resolve.pixels(light, tile, samples, background), tile, samples)
        return canvas.pixels

    def buffers(
        self,
        scene: SceneLike,
        *,
        size: Size = (800, 600),
        mapping: Mapping = Mapping.CORRECTED,
        contact: Contact = Contact.PAPER,
        viewpoint: Viewpoint | None = None,
    ) -> Buffers:
        """Give what lies behind every pixel's centre; arguments and errors as for `render`."""
        check_size(size, 1)
        canvas = BufferCanvas(size)
        for tile, targets in self._tiles(scene, viewpoint, size, 1, Modes(mapping, contact), buffers=True):
            canvas.place(targets, tile)
        return canvas.buffers

    def buffers_at(
        self,
        scene: SceneLike,
        x: int,
        y: int,
        *,
        size: Size = (800, 600),
        mapping: Mapping = Mapping.CORRECTED,
        contact: Contact = Contact.PAPER,
        viewpoint: Viewpoint | None = None,
    ) -> Buffers:
        """Give what lies behind one pixel of a picture, arrays of 1 × 1; nothing else is drawn.

        ``(x, y)`` counts from the lower left corner; other arguments and errors are those of `buffers`.
        (Its colour knows no surroundings that keep light out.)
        """
        check_size(size, 1)
        for name, place, side in (("x", x, size[0]), ("y", y, size[1])):
            whole(name, place, 0, side - 1, InvalidPoints)
        with self.context.current():
            uploaded = self._uploads.of(scene)
            picture = Picture.of(viewpoint_of(scene, viewpoint), size, uploaded.bounds)
            tile = picture.part(Rectangle(x, y, 1, 1))
            targets = self._targets.of(BUFFERS_SLOT, (1, 1))
            self._draw_tile(scene, uploaded, tile, targets, Modes(mapping, contact))
            canvas = BufferCanvas((1, 1))
            canvas.place(targets, Tile(picture, 0, 0, 1, 1, Rectangle(0, 0, 1, 1)))
            return canvas.buffers

    def draw(
        self,
        scene: SceneLike,
        *,
        size: Size,
        samples: int = 1,
        mapping: Mapping = Mapping.CORRECTED,
        contact: Contact = Contact.PAPER,
        viewpoint: Viewpoint | None = None,
        lamps: Lamps | None = None,
    ) -> Targets:
        """Draw a scene at once, without tiles, and leave it on the graphics card.

        Light and depth of all samples are in the targets until something else is drawn. The context must be
        current. Arguments and errors as for `render`.
        """
        drawing = self.drawing(
            scene,
            size=size,
            samples=samples,
            mapping=mapping,
            contact=contact,
            viewpoint=viewpoint,
            lamps=lamps,
        )
        drawing.complete()
        self.sweep()
        return drawing.targets

    def drawing(
        self,
        scene: SceneLike,
        *,
        size: Size,
        samples: int = 1,
        mapping: Mapping = Mapping.CORRECTED,
        contact: Contact = Contact.PAPER,
        viewpoint: Viewpoint | None = None,
        lamps: Lamps | None = None,
        slot: str = WHOLE_SLOT,
    ) -> Drawing:
        """Give a scene's picture in the making: it is drawn part by part, and stays on the graphics card.

        It needs a scene and a viewpoint that stay as they are. Drawings of different slots, any texts, do
        not overwrite each other. The context must be current. Other arguments and errors as for `render`.
        """
        check_size(size, samples)
        full = size[0] * samples, size[1] * samples
        if max(full) > self.context.max_texture_size:
            raise InvalidScene(
                f"expected at most {self.context.max_texture_size} samples along each axis, got {full[0]} x "
                f"{full[1]}; take fewer a pixel, or `render` draws in parts"
            )

        check_scene(scene)
        modes = Modes(mapping, contact, lamps)
        order = Order(scene, viewpoint_of(scene, viewpoint), full, modes)

        def plan(targets: Targets, held: Shown | None) -> Plan:
            uploaded = self._uploads.of(scene)  # again each time: others may draw in between
            tile = order.tile(uploaded.bounds)
            self._camera.use(tile)
            return plan_of(scene, uploaded, tile, order.modes, targets, held, depth=True)

        making = chain(self._making(scene, modes), self._targets.making(slot, full))
        return Drawing(
            making, plan, self.context.gl.finish, left=lambda: order.share(self._targets.get(slot))
        )

    def ahead(self, scene: SceneLike, modes: Modes) -> Ahead:
        """Say what such pictures of a scene need that takes long for the first time.

        Raises
        ------
        InvalidScene
            The scene holds an object of unknown kind.
        """
        return ahead_of_scene(self._uploads, scene, modes)

    def _making(self, scene: SceneLike, modes: Modes) -> Iterator[str]:
        """Make all of that, once; after each piece say how far it is."""
        ahead = self.ahead(scene, modes)
        if ahead.key not in self._made:
            for piece, news in told(ahead.pieces):
                piece.make()
                yield news
            self._made.add(ahead.key)

    def time_frame(
        self,
        scene: SceneLike,
        *,
        size: Size = (800, 600),
        mapping: Mapping = Mapping.CORRECTED,
        contact: Contact = Contact.PAPER,
    ) -> float:
        """Give the seconds that one picture takes to draw, one sample a pixel, without reading it back.

        What a scene uploads is counted where it is drawn for the first time. Arguments and errors as for
        `render`.
        """
        check_size(size, 1)
        with self.context.current():
            self._targets.forget()
            self.context.gl.finish()
            begin = time.perf_counter()
            for _ in self._tiles(scene, None, size, 1, Modes(mapping, contact)):
                pass
            self.context.gl.finish()
            return time.perf_counter() - begin

    def targets_of(self, slot: str) -> Targets | None:
        """Give what the last drawing of a slot was drawn into, if there was one."""
        return self._targets.get(slot)

    @property
    def entry(self) -> Entry:
        """How passes over all pixels are run: as fragment or as compute shaders."""
        with self.context.current():
            return self.context.entry

    def _tiles(
        self,
        scene: SceneLike,
        viewpoint: Viewpoint | None,
        size: Size,
        samples: int,
        modes: Modes,
        *,
        buffers: bool = False,
    ) -> Iterator[tuple[Tile, Targets]]:
        """Draw tile after tile; the targets hold a tile until the next is asked for."""
        with self.context.current():
            uploaded = self._uploads.of(scene)
            full = size[0] * samples, size[1] * samples
            picture = Picture.of(viewpoint_of(scene, viewpoint), full, uploaded.bounds)
            slot = BUFFERS_SLOT if buffers else WHOLE_SLOT
            targets = self._targets.of(slot, largest_tile(size, samples, limit=self._max_tile))
            for tile in tiles(picture, samples, limit=self._max_tile):
                self._draw_tile(scene, uploaded, tile, targets, modes)
                yield tile, targets
            self.sweep()

    def _draw_tile(
        self, scene: SceneLike, uploaded: Uploaded, tile: Tile, targets: Targets, modes: Modes
    ) -> None:
        self._camera.use(tile)
        plan = partial(plan_of, scene, uploaded, tile, modes, depth=False)
        Drawing(iter([targets]), plan, self.context.gl.finish).complete()

    def sweep(self) -> None:
        """Give back what was uploaded for other pictures than those since the last sweep."""
        self._uploads.sweep()

    def uploads(self, scene: SceneLike) -> tuple[DecalData | None, ImageArray | None]:
        """Give a scene's decals and images as they are on the graphics card, for other shaders than ours.

        They stay until another scene is drawn. The context must be current.
        """
        return self._uploads.decals(scene), self._uploads.images(scene)

    def release(self) -> None:
        """Give everything back. Calling twice is harmless."""
        with self.context.current():
            self._targets.release()
            self._uploads.release()
            self._camera.release()
        if self._owned:
            self.context.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()
