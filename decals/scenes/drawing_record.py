"""How a scene is drawn, as its file has it."""

from pathlib import Path
from typing import Literal

from msgspec import Struct
from msgspec.structs import asdict

from decals.errors import ImplicitDecalsError, InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import LAWS, ContactLaw
from decals.images.load import embedded_image, is_embedded, opaque
from decals.record import DEFAULT_STIFFNESS, Contact
from decals.rendering.environment import Environment
from decals.rendering.lights import Light, Lighting
from decals.rendering.options import STUDIO, Background, Drawing
from decals.scenes.camera import Vector
from decals.scenes.records import absolute, picture_source

FORMER_CONTACT = Contact.PRODUCT
"""Contact mode of files that name none: their pictures were drawn with it."""

Rgba = tuple[float, float, float, float]


class _BackgroundRecord(Struct, forbid_unknown_fields=True):
    top: Rgba
    bottom: Rgba


class _LightRecord(Struct, forbid_unknown_fields=True, omit_defaults=True):
    color: Vector
    direction: Vector
    position: Vector | None = None
    attenuation: Vector = (1.0, 0.0, 0.0)
    cone: float = 180.0
    exponent: float = 1.0


class _LightingRecord(Struct, forbid_unknown_fields=True):
    lights: tuple[_LightRecord, ...]
    frame: tuple[float, ...]


class _EnvironmentRecord(Struct, forbid_unknown_fields=True, omit_defaults=True):
    picture: str
    rotation: float = 0.0
    strength: float = 1.0
    visible: bool = False
    up: Vector = (0.0, 1.0, 0.0)


class DrawingRecord(Struct, forbid_unknown_fields=True):
    """Modes are always written, so that other defaults of later versions change no picture."""

    contact: Literal["product", "min", "radial", "elastic"] = "product"
    stiffness: float = DEFAULT_STIFFNESS
    mapping: Literal["corrected", "chord", "walked"] = "corrected"
    samples: int = 2
    background: _BackgroundRecord | None = None
    lights: _LightingRecord | None = None
    law: str | None = None
    filtered: bool = False
    environment: _EnvironmentRecord | None = None

    def sources(self) -> list[str]:
        """Return the files that the record names."""
        pictures = [] if self.environment is None else [self.environment.picture]
        return [picture for picture in pictures if not is_embedded(picture)]


def drawing_record(drawing: Drawing, folder: Path) -> DrawingRecord:
    """Describe how a scene is drawn; paths are relative to the folder."""
    lights = drawing.lights
    described = None
    if lights is not None:
        names = _LightRecord.__struct_fields__
        each = (_LightRecord(*(getattr(light, name) for name in names)) for light in lights.lights)
        described = _LightingRecord(tuple(each), tuple(lights.frame))
    return DrawingRecord(
        contact=Contact(int(drawing.contact)).name.lower(),  # type: ignore[arg-type]  # names of members
        stiffness=drawing.stiffness,
        mapping=drawing.mapping.name.lower(),  # type: ignore[arg-type]
        samples=drawing.samples,
        background=None
        if drawing.background == STUDIO
        else _BackgroundRecord(drawing.background.top, drawing.background.bottom),
        lights=described,
        law=drawing.contact.name if isinstance(drawing.contact, ContactLaw) else None,
        filtered=drawing.filtered,
        environment=None if drawing.environment is None else _environment_record(drawing.environment, folder),
    )


def _environment_record(environment: Environment, folder: Path) -> _EnvironmentRecord:
    panorama = environment.picture
    picture = picture_source(panorama.source, folder) or embedded_image(opaque(panorama.light))
    others = _EnvironmentRecord.__struct_fields__[1:]
    return _EnvironmentRecord(picture, *(getattr(environment, name) for name in others))


def drawing_of_record(record: DrawingRecord | None, folder: Path) -> Drawing:
    """Return how a scene is drawn. Pictures of files without this record were drawn with equation 5.

    Raises
    ------
    InvalidScene
        If a value is out of range.
    """
    if record is None:
        return Drawing(contact=FORMER_CONTACT)
    try:
        lights = None
        if record.lights is not None:
            if len(record.lights.frame) != 16:
                raise InvalidScene(
                    f"frame of the lights: expected 16 numbers, got {len(record.lights.frame)}"
                )
            names = _LightRecord.__struct_fields__
            each = (Light(*(getattr(light, name) for name in names)) for light in record.lights.lights)
            lights = Lighting(tuple(each), record.lights.frame)
        environment = None
        if record.environment is not None:
            parts = asdict(record.environment)
            environment = Environment(absolute(parts.pop("picture"), folder), **parts)
        return Drawing(
            samples=record.samples,
            contact=Contact[record.contact.upper()] if record.law is None else _law(record.law),
            mapping=ImageMapping[record.mapping.upper()],
            background=STUDIO
            if record.background is None
            else Background(record.background.top, record.background.bottom),
            lights=lights,
            stiffness=record.stiffness,
            filtered=record.filtered,
            environment=environment,
        )
    except ImplicitDecalsError as error:
        raise InvalidScene(f"drawing: {error}") from error


def _law(name: str) -> ContactLaw:
    if name not in LAWS:
        raise InvalidScene(
            f"expected a contact law that is defined in this process, got {name!r}; import the module that "
            "defines it first (--define on the command line)"
        )
    return LAWS[name]
