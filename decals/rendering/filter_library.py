"""The typed functions that ``shaders/filtered_decals.glsl`` calls, in the order of its text."""

from decals.field.elastic import bump_at, image_shift, join_bumps
from decals.field.pixel_filter import (
    contact_distance,
    image_steps,
    inner_part,
    pixel_line,
    push_gradient,
    pushed_steps,
)
from decals.field.radial import is_above, lies_on_top, power
from decals.field.receivers import acts
from decals.record import balls_nested, has_cells
from decals.rendering.decal_library import FUNCTIONS, LIBRARY_FUNCTIONS

FUNCTIONS["filtered_decals.glsl"] = (
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
