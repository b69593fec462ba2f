"""How a scene is drawn, as its file has it."""

from typing import Literal

from msgspec import Struct

from decals.errors import ImplicitDecalsError, InvalidScene
from decals.field.law import LAWS, ContactLaw
from decals.field.mapping import ImageMapping
from decals.record import DEFAULT_STIFFNESS, Contact
from decals.rendering.lights import Light, Lighting
from decals.rendering.options import STUDIO, Background, Drawing
from decals.scenes.camera import Vector

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


def drawing_record(drawing: Drawing) -> DrawingRecord:
    """Describe how a scene is drawn."""
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
    )


def drawing_of_record(record: DrawingRecord | None) -> Drawing:
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
