"""Settings of a subplot: samples, size, modes and lights, checked when they are set."""

from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.record import Contact
from decals.validation import describe, finite_number, member, whole_number
from decals.vtk.lights import Lights

MAX_SAMPLES = 16
"""Samples per pixel along each axis, at most: graphics cards have no larger targets for usual windows."""


class SubplotSettings:
    """Settings of a subplot, which apply from the next frame on.

    Attributes
    ----------
    wait_for_gpu : bool
        If True, frames end when the graphics card has finished, so that they can be timed.
    keep_previous_frame : bool
        If True, the previous frame stays while shaders compile; see `SubplotRenderer.warm`.
    """

    def __init__(self) -> None:
        self._samples, self._draw_scale = 2, 1.0
        self._mapping, self._contact = ImageMapping.CORRECTED, Contact.PRODUCT
        self._lights = Lights.SCENE
        self.wait_for_gpu = self.keep_previous_frame = False

    @property
    def draw_scale(self) -> float:
        """Size of the picture relative to the window, in (0, 1].

        Below 1, the picture has one sample per texel and is magnified.
        """
        return self._draw_scale

    @draw_scale.setter
    def draw_scale(self, scale: float) -> None:
        number = finite_number("draw_scale", scale, InvalidScene)
        if not 0.0 < number <= 1.0:
            raise InvalidScene(f"draw_scale: expected a number above 0 and at most 1, got {number}")
        self._draw_scale = number

    @property
    def samples(self) -> int:
        """Samples per pixel along each axis; one in screenshots that VTK draws larger than the window."""
        return self._samples

    @samples.setter
    def samples(self, samples: int) -> None:
        self._samples = whole_number("samples", samples, 1, MAX_SAMPLES, InvalidScene)

    @property
    def mapping(self) -> ImageMapping:
        """Image mapping; see `decals.ImageMapping`."""
        return self._mapping

    @mapping.setter
    def mapping(self, mapping: ImageMapping) -> None:
        self._mapping = member("mapping", mapping, ImageMapping, InvalidScene)

    @property
    def contact(self) -> Contact:
        """Contact mode; see `decals.Contact`."""
        return self._contact

    @contact.setter
    def contact(self, contact: Contact) -> None:
        self._contact = member("contact", contact, Contact, InvalidScene)

    @property
    def lights(self) -> Lights:
        """Lights: the studio light, or the plotter's lights; see `Lights`."""
        return self._lights

    @lights.setter
    def lights(self, lights: Lights | str) -> None:
        try:
            self._lights = Lights(lights)
        except ValueError as error:
            raise InvalidScene(f"lights must be 'scene' or 'vtk'; got {describe(lights)}") from error
