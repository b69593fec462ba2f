"""The panel of the selected decals, of the brush and of the contact modes."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from blobtree.validation import describe
from decals.apps.sandbox.controls import STEPS, Control, option_control, parsed_option
from decals.apps.sandbox.outline import picture
from decals.editing.action_state import ActionState
from decals.editing.brush_settings import Brush, BrushSettings
from decals.editing.brushes import default_decal_radius, default_radius, positive_number
from decals.editing.commands import ReplaceImage, SetValues
from decals.editing.decal_actions import FIRST_DECAL_COUNT
from decals.editing.document import Document
from decals.editing.scatter_commands import ScatterDecals
from decals.editing.zone_actions import ZoneActions
from decals.errors import InvalidEdit
from decals.model import FADE_ANGLES, FADE_DEPTHS, NO_IMAGE, Decals
from decals.options import Option, Values, arguments_of, described, options_of, values_of
from decals.receivers import labels_of
from decals.rendering.options import Drawing
from decals.scattering.copies import has_copies
from decals.scattering.scatter import scatter
from decals.scenes.material import DecalMaterial
from decals.scenes.objects import TreeObject
from decals.scenes.scene import DecalImage
from decals.validation import number_of, one_of

PLAIN = "tint alone"
"""Choice of an image that stands for none."""

COLUMNS = {
    "radius": "radii",
    "opacity": "opacities",
    "image": "images",
    "tint": "tints",
    "interaction": "interactions",
    "layer": "layers",
    "spill": "spill",
    "receivers": "receivers",
    "fade_angle": "fade_angles",
    "fade_depth": "fade_depths",
    "single_sheet": "single_sheets",
}
"""Arrays of `decals.Decals` by the names of their controls."""

ZONE, COPIES = "zone_density", "same_on_copies"
SCATTER = {**options_of(scatter), ZONE: options_of(ZoneActions.scatter)[ZONE]}
COPIES_DOC = "put the decals of one copy of a repeat on all copies, which share the count; not for zones"
SCATTER |= {COPIES: Option(COPIES, bool, COPIES_DOC, Values(label="same decals on all copies"), False, False)}
"""Options of the next scattering beside the images; the last ones are for zones, and for repeats, alone."""

NOT_OF_SCATTER = ("spacing",)
"""Options of `decals.scatter` that another option decides."""

MATTE = {"roughness": 1.0, "metallic": 0.0, "occlusion": 1.0, "relief": 0.0}
"""Numbers of an image without maps."""

PREVIEW_SIZE = 240
"""Width and height of the picture of the selected image, in pixels."""

MAP_SHARE = 255.0
"""Level of a map that stands for 1."""

ANY_OBJECT = "any object"
"""Choice of receivers that stands for all objects."""


def decal_controls(document: Document, selection: tuple[int, ...]) -> list[dict[str, Any]]:
    """Return the controls of the selected decals, with the values of the last one."""
    if not selection:
        return []
    last, options = document.decals[selection[-1]], options_of(Decals)
    reach = 2.5 * default_radius(document)
    names, receivers = image_names(document), str(last.receivers[0])
    controls = []
    for name, array in COLUMNS.items():
        value = getattr(last, array)[0]
        if name == "image":
            controls.append(vars(Control.choice(name, names[int(value) + 1], names, "image")))
        elif name == "receivers":
            choices, doc = receiver_choices(document, receivers), described(Decals)[array]
            controls.append(vars(Control.choice(name, receivers or ANY_OBJECT, choices, doc)))
        else:
            ends = (reach / STEPS, reach) if name == "radius" else ()
            controls.append(option_control(replace(options[array], name=name), value.tolist(), *ends))
    return controls


def image_names(document: Document) -> list[str]:
    """Return the names of the images, each once, after that of none."""
    names = [PLAIN]
    for number, image in enumerate(document.images):
        name = Path(image.source).name[:40] or f"image {number}"
        names.append(name if name not in names else f"{name} ({number})")
    return names


def receiver_choices(document: Document, present: str) -> list[str]:
    """Return the receivers to choose from: any object, each label of the objects, and the present ones."""
    labels = sorted(frozenset[str]().union(*map(labels_of, document.objects)))
    return [ANY_OBJECT, *labels, *([present] if present and present not in labels else [])]


def parsed_decal_value(document: Document, name: str, raw: Any) -> Any:
    """Return what a page sent for a value of decals, or raise `InvalidEdit`."""
    match name:
        case "image":
            names = image_names(document)
            return names.index(one_of(name, raw, names, InvalidEdit)) + NO_IMAGE
        case "receivers":
            return "" if raw == ANY_OBJECT else raw
        case "fade_angle" | "fade_depth":
            least = (FADE_ANGLES if name == "fade_angle" else FADE_DEPTHS)[0]
            number = number_of(name, raw, InvalidEdit)
            return 0.0 if 0.0 <= number < least else number
        case str() if name in COLUMNS:
            return replace(options_of(Decals)[COLUMNS[name]], name=name).parsed(raw, InvalidEdit)
    raise InvalidEdit(f"value of decals: expected one of {', '.join(COLUMNS)}, got {describe(name)}")


def set_decal_value(state: ActionState, name: str, raw: Any, *, last: bool, **_others: object) -> None:
    """Set a value of all selected decals; moves of a slider are one undo entry."""
    numbers = state.selected_numbers
    value = parsed_decal_value(state.session.document, name, raw)
    state.run_step(SetValues.each(numbers, f"set {name}", **{COLUMNS[name]: value}), last=last)


# -- brush and modes ------------------------------------------------------------------------------------


def brush_values(document: Document, brush: BrushSettings) -> dict[str, Any]:
    """Return the brush and its controls; the sizes of brushes need the surface, which selecting does not."""
    if brush.brush in (Brush.SELECT, Brush.BOX, Brush.LASSO, Brush.PULL):
        return {"brush": str(brush.brush), "controls": []}
    usual, decal = default_radius(document), brush.decal_radius or default_decal_radius(document)
    shown: dict[str, tuple[float, ...]] = {"radius": (brush.radius or usual, usual / STEPS, 4.0 * usual)}
    if brush.brush is Brush.SCATTER:
        shown |= {"decal_radius": (decal, usual / STEPS, usual), "density": (brush.density,)}
    options = options_of(BrushSettings)
    controls = [option_control(options[name], *values) for name, values in shown.items()]
    if brush.brush is Brush.SCATTER:
        controls.append(_images_control(document, brush.images, described(BrushSettings)["images"]))
    return {"brush": str(brush.brush), "controls": controls}


def set_brush(state: ActionState, name: str, raw: Any, **_others: object) -> None:
    """Set the brush, its images, or one of its numbers, to what a page sent."""
    brush = state.brush
    if name == "images":
        document = state.session.document
        brush.images = _numbers_of(document, chosen_images(document, raw))
        return
    value = parsed_option(BrushSettings, name, raw)
    if name != "brush":
        positive_number(name, value)
    setattr(brush, name, value)


def _images_control(document: Document, images: Sequence[int], doc: str) -> dict[str, Any]:
    """Return the control that chooses some of the images; none stands for all."""
    names = tuple(image_names(document)[1:])
    chosen = [names[image] for image in images if image < len(names)] or list(names)
    return vars(Control("images", "choices", chosen, doc, choices=names))


def chosen_images(document: Document, raw: Any) -> tuple[str, ...]:
    """Return the checked names of the images that a page sent; none for all."""
    names, given = image_names(document)[1:], raw if isinstance(raw, list) else [raw]
    chosen = tuple(one_of("image", one, names, InvalidEdit) for one in given)
    return chosen if len(chosen) < len(names) else ()


def _numbers_of(document: Document, names: Sequence[str]) -> tuple[int, ...]:
    """Return the numbers of the images with some names; those that are gone are left out."""
    known = image_names(document)[1:]
    return tuple(known.index(name) for name in names if name in known)


# -- options of functions and classes -------------------------------------------------------------------


def drawing_controls(drawing: Drawing) -> list[dict[str, Any]]:
    """Return the controls of how the scene is drawn."""
    options = options_of(Drawing)
    return [option_control(options[name], value) for name, value in values_of(Drawing, drawing).items()]


def set_drawing(state: ActionState, name: str, raw: Any, *, last: bool, **_others: object) -> None:
    """Set an option of how the scene is drawn; moves of a slider are one undo entry."""
    drawing = state.session.document.drawing
    one_of("option", name, values_of(Drawing, drawing), InvalidEdit)
    whole, _, part = name.partition(".")
    value = parsed_option(Drawing, name, raw)
    value = replace(getattr(drawing, whole), **{part: value}) if part else value
    state.draw_with(f"set {name}", last=last, **{whole: value})


def scatter_values(document: Document, chosen: dict[str, Any]) -> dict[str, Any]:
    """Return the options of the next scattering: those that were chosen, else the first ones."""
    trees = [item.tree for item in document.objects if isinstance(item, TreeObject)]
    left_out = NOT_OF_SCATTER if any(map(has_copies, trees)) else (*NOT_OF_SCATTER, COPIES)
    first = {name: option.default for name, option in SCATTER.items() if name not in left_out}
    first |= {"images": (), "count": len(document.decals) or FIRST_DECAL_COUNT}
    return first | {name: value for name, value in chosen.items() if name in first}


def scatter_arguments(document: Document, values: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of the next scattering; raise an error for those that it would refuse."""
    arguments = arguments_of(scatter, values)
    images = _numbers_of(document, arguments.pop("images"))
    arguments |= {"images": images} if images else {}
    options = dict(arguments)
    count, seed = options.pop("count"), options.pop("seed")
    ScatterDecals((), 0 if count is None else count, seed, options).check_values()
    positive_number(SCATTER[ZONE].values.label, values[ZONE])
    return arguments


def scatter_controls(document: Document, values: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the controls of the options of the next scattering."""
    images = _images_control(document, _numbers_of(document, values["images"]), "those of the next decals")
    shown = [option_control(SCATTER[name], value) for name, value in values.items() if name in SCATTER]
    return [images, *shown]


def image_values(document: Document, number: int | None) -> dict[str, Any]:
    """Return name, picture and controls of an image; they are empty if there is no number."""
    if number is None or number >= len(document.images):
        return {"name": "", "picture": "", "controls": []}
    image = document.images[number]
    controls = [
        option_control(option, _level(image, name)) for name, option in options_of(DecalMaterial).items()
    ]
    return {
        "name": image_names(document)[number + 1],
        "picture": picture(image, PREVIEW_SIZE),
        "controls": controls,
    }


def _level(image: DecalImage, name: str) -> float | None:
    """Return a number of a material, or that of a map which is the same everywhere, else None."""
    value = getattr(image, name, MATTE[name])
    if not isinstance(value, np.ndarray):
        return float(value)
    return value.flat[0] / MAP_SHARE if value.min() == value.max() else None


def set_image_value(state: ActionState, number: int, name: str, raw: Any, *, last: bool) -> None:
    """Set a number of an image, which becomes a material."""
    image = state.session.document.images[number]
    values: dict[str, Any] = {name: parsed_option(DecalMaterial, name, raw)}
    if not isinstance(image, DecalMaterial):
        image = DecalMaterial(image.source, image.pixels)
    state.run_step(ReplaceImage(number, replace(image, **values), f"set {name}"), last=last)
