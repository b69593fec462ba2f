"""How a stage draws: samples, size, modes and lights, checked when they are set."""

from decals.checks import finite, member, shown, whole
from decals.errors import InvalidScene
from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.vtk.lights import Lights

MOST_SAMPLES = 16
"""Along each axis; graphics cards have no targets for more in a window of the usual size."""


class Settings:
    """What may be set at any time; the next frame shows it."""

    def __init__(self) -> None:
        self._samples, self._draw_scale = 2, 1.0
        self._mapping, self._contact = Mapping.CORRECTED, Contact.PAPER
        self._lights = Lights.SCENE

    @property
    def draw_scale(self) -> float:
        """Size of what is drawn relative to the window's.

        Below 1, one sample a texel is drawn and magnified: for the time that things move.
        """
        return self._draw_scale

    @draw_scale.setter
    def draw_scale(self, scale: float) -> None:
        number = finite("draw_scale", scale, InvalidScene)
        if not 0.0 < number <= 1.0:
            raise InvalidScene(f"draw_scale: expected a number above 0 and at most 1, got {number}")
        self._draw_scale = number

    @property
    def samples(self) -> int:
        """Samples a pixel along each axis; where VTK itself draws larger than the window, one."""
        return self._samples

    @samples.setter
    def samples(self, samples: int) -> None:
        self._samples = whole("samples", samples, 1, MOST_SAMPLES, InvalidScene)

    @property
    def mapping(self) -> Mapping:
        """How images lie on curved surface; as for `decals.render.Renderer.render`."""
        return self._mapping

    @mapping.setter
    def mapping(self, mapping: Mapping) -> None:
        self._mapping = member("mapping", mapping, Mapping, InvalidScene)

    @property
    def contact(self) -> Contact:
        """How decals push each other; as for `decals.render.Renderer.render`."""
        return self._contact

    @contact.setter
    def contact(self, contact: Contact) -> None:
        self._contact = member("contact", contact, Contact, InvalidScene)

    @property
    def lights(self) -> Lights:
        """Who lights what is shown: the scene's own studio light, or the plotter's lights."""
        return self._lights

    @lights.setter
    def lights(self, lights: Lights | str) -> None:
        try:
            self._lights = Lights(lights)
        except ValueError as error:
            raise InvalidScene(f"lights must be 'scene' or 'vtk'; got {shown(lights)}") from error
