"""GLSL of all decal formulas: the text that fills the slot ``functions`` of the shaders of decals."""

from functools import cache
from typing import Any

from blobtree.formulas.falloff import RIM
from blobtree.transpile.glsl import translate_library
from decals.field.contact_mode import AnyContact, ContactLaw
from decals.field.elastic import bump_at, image_shift, join_bumps
from decals.field.mapping import in_image, tangent_coordinates, unroll_step
from decals.field.ownership import contact_at, owner_at, owner_below, single_layer_at, uv_at
from decals.field.pixel_filter import (
    contact_distance,
    image_steps,
    inner_part,
    pixel_line,
    push_gradient,
    pushed_steps,
)
from decals.field.radial import is_above, lies_on_top, power
from decals.field.receivers import acts, fade_at
from decals.index.lookup import next_number_below
from decals.record import NEIGHBOR_REACH, OPAQUE_ALPHA, Contact, balls_nested, has_cells

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
    fade_at,
)
"""Functions that ``shaders/decals.glsl`` calls."""


FILTER_FUNCTIONS = (
    *LIBRARY_FUNCTIONS,
    acts,
    contact_distance,
    power,
    balls_nested,
    is_above,
    lies_on_top,
    has_cells,
    pixel_line,
    inner_part,
    push_gradient,
    pushed_steps,
    image_steps,
    bump_at,
    join_bumps,
    image_shift,
)
"""Functions that ``shaders/filtered_decals.glsl`` calls."""


@cache
def decal_library(
    contact: AnyContact,
    *,
    layered: bool,
    limited: bool,
    nested: bool,
    walked: bool = False,
    filtered: bool = False,
) -> str:
    """Return the GLSL of all decal formulas in one contact mode or law, without those that never run."""
    constants = _constants(contact, layered=layered, limited=limited, nested=nested, walked=walked)
    law = contact if isinstance(contact, ContactLaw) else None
    functions = translate_library(
        decal_functions(law, filtered=filtered), constants={**constants, "contact": int(contact)}
    )
    return _declared(constants) + functions


def decal_constants(contact: AnyContact, *, layered: bool, limited: bool, nested: bool, walked: bool) -> str:
    """Return the GLSL constants of decals, for the slot ``functions``, in one contact mode or law."""
    return _declared(_constants(contact, layered=layered, limited=limited, nested=nested, walked=walked))


def _constants(
    contact: AnyContact, *, layered: bool, limited: bool, nested: bool, walked: bool
) -> dict[str, bool | int]:
    """Return the values of constants by their names."""
    return {
        "decal_contact": int(contact),
        "decal_nested": nested and contact in (Contact.RADIAL, Contact.ELASTIC),
        "decal_limited": limited,
        "decal_walked": walked,
        "decal_layered": layered,
        "decal_single_layer": not layered and contact != Contact.RADIAL,
    }


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


def decal_functions(law: ContactLaw | None, *, filtered: bool = False) -> tuple[Any, ...]:
    """Return the typed functions that ``decals.glsl`` or ``filtered_decals.glsl`` calls."""
    functions: tuple[Any, ...] = FILTER_FUNCTIONS if filtered else LIBRARY_FUNCTIONS
    return functions if law is None else tuple(map(law.formulas.function, functions))
