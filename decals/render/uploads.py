"""What a renderer has put on the graphics card."""

from decals.grid.editor import DecalEditor
from decals.render.context import Context
from decals.render.decal_data import DecalData
from decals.render.drawables import Drawable, drawable_for
from decals.render.kept import Kept
from decals.render.scene_like import SceneLike
from decals.render.steps import Uploaded
from decals.render.textures import ImageArray
from decals.render.wishes import check_scene


class Uploads:
    """Objects, decals and images of scenes on the card: they stay until `sweep` finds that nobody asked.

    The context must be current.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self._drawables: Kept[Drawable] = Kept()
        self._decals: Kept[DecalData] = Kept()
        self._images: Kept[ImageArray] = Kept()

    def of(self, scene: SceneLike) -> Uploaded:
        """Give all of a scene; errors of `wishes.check_scene`."""
        check_scene(scene)
        drawables = [self.drawable(thing) for thing in scene.objects]
        return Uploaded(drawables, self.decals(scene), self.images(scene))

    def drawable(self, thing: object) -> Drawable:
        """Give an object."""
        return self._drawables.get(lambda: drawable_for(self.context, thing), thing)

    def decals(self, scene: SceneLike) -> DecalData | None:
        """Give a scene's decals, if there are any."""
        decals = scene.decals
        if not len(decals):
            return None
        data = self._decals.get(lambda: DecalData(self.context, decals), decals)
        if isinstance(decals, DecalEditor):
            data.update(decals)
        return data

    def images(self, scene: SceneLike) -> ImageArray | None:
        """Give the images of a scene's decals, if there are any."""
        if not len(scene.decals):
            return None
        pixels = [image.pixels for image in scene.images]
        return self._images.get(lambda: ImageArray(self.context, pixels), *pixels)

    def sweep(self) -> None:
        """Give back what was not asked for since the last sweep."""
        for kept in (self._drawables, self._decals, self._images):
            kept.sweep()

    def release(self) -> None:
        """Give everything back."""
        for kept in (self._drawables, self._decals, self._images):
            kept.release()
