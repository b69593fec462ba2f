"""How decals are drawn."""

from dataclasses import dataclass

from decals.checks import instance, member
from decals.errors import InvalidScene
from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.render.lamps import Lamps


@dataclass(frozen=True)
class Modes:
    """How images lie on curved surface, how decals push each other, and lamps, if not the studio's."""

    mapping: Mapping
    contact: Contact
    lamps: Lamps | None = None

    def __post_init__(self) -> None:
        member("mapping", self.mapping, Mapping, InvalidScene)
        member("contact", self.contact, Contact, InvalidScene)
        if self.lamps is not None:
            instance("lamps", self.lamps, Lamps, InvalidScene, "leave them out for the studio's light")
