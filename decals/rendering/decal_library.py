"""GLSL of all decal formulas: the text that fills the slot ``functions`` of the shaders of decals."""

from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any

from blobtree.formulas.falloff import RIM
from blobtree.transpile.glsl import translate_library
from decals.field.mapping import in_image, tangent_coordinates, unroll_step
from decals.field.ownership import contact_at, owner_at, owner_below, single_layer_at, uv_at
from decals.field.receivers import opacity_at
from decals.field.rules import AnyContact, with_law
from decals.index.lookup import next_number_below
from decals.record import NEIGHBOR_REACH, OPAQUE_ALPHA, Contact

LIBRARY_FUNCTIONS = (
    single_layer_at,
    owner_at,
    owner_below,
    next_number_below,
    contact_at,
    uv_at,
    in_image,
    tangent_coordinates,
    unroll_step,
    opacity_at,
)
"""Functions that ``shaders/decals.glsl`` calls."""

FUNCTIONS: dict[str, tuple[Any, ...]] = {"decals.glsl": LIBRARY_FUNCTIONS}
"""Functions that shader files call, by the names of the files."""


@dataclass(frozen=True)
class Form:
    """The values on which the GLSL of decals depends. Everything else is in textures and uniforms.

    Attributes
    ----------
    contact
        Contact mode, or a law, which only our own programs may use.
    layered
        True if decals can cover each other.
    limited
        True if decals have receivers or fades.
    nested
        True if contact decals may be nested.
    materials
        True if images have maps.
    relief
        True if images have heights that are drawn.
    walked
        True for the image mapping WALKED.
    filtered
        True if decals are averaged over pixels.
    """

    contact: AnyContact
    layered: bool = False
    limited: bool = False
    nested: bool = False
    materials: bool = False
    relief: bool = False
    walked: bool = False
    filtered: bool = False

    @classmethod
    def all(cls) -> "list[Form]":
        """Return all forms for the shaders of other programs, which have the first flags alone."""
        return [cls(contact, *row) for contact, row in product(Contact, product((False, True), repeat=4))]

    def covers(self, decals: Any, *, limited: bool) -> bool:
        """Return True if the code of this form evaluates decals, `DecalArrays`."""
        return self.layered >= decals.layered and self.limited >= limited and self.nested >= decals.nested

    def _values(self) -> dict[str, bool | int]:
        """Return the values of constants by their names."""
        return {
            "decal_contact": int(self.contact),
            "decal_nested": self.nested and self.contact in (Contact.RADIAL, Contact.ELASTIC),
            "decal_limited": self.limited,
            "decal_walked": self.walked,
            "decal_layered": self.layered,
            "decal_single_layer": not self.layered and self.contact != Contact.RADIAL,
        }

    @property
    def constants(self) -> str:
        """The GLSL constants of decals, for the slot ``functions``."""
        return _declared(self._values())

    @property
    def functions(self) -> tuple[Any, ...]:
        """The typed functions that ``decals.glsl`` or ``filtered_decals.glsl`` calls."""
        functions = FUNCTIONS["filtered_decals.glsl" if self.filtered else "decals.glsl"]
        return tuple(with_law(function, self.contact) for function in functions)


def decal_library(form: Form) -> str:
    """Return the GLSL of all decal formulas in a form, without those that never run."""
    return _library(replace(form, materials=False, relief=False))


@cache
def _library(form: Form) -> str:
    constants = {**form._values(), "contact": int(form.contact)}
    return form.constants + translate_library(form.functions, constants=constants)


def _declared(constants: dict[str, bool | int]) -> str:
    """Return the declarations of constants."""
    shared = {
        "RIM": float(RIM),
        "REACH": NEIGHBOR_REACH,
        "OPAQUE": OPAQUE_ALPHA,
        "ELASTIC": int(Contact.ELASTIC),
    }
    return "".join(
        f"const {type(value).__name__} {name} = {str(value).lower()};\n"
        for name, value in (shared | constants).items()
    )
