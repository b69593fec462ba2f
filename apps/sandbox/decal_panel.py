"""The panel of the selected decals, of the brush and of the contact modes."""

from collections.abc import Callable
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from blobtree.colors import color_rgb
from decals.apps.sandbox.controls import STEPS, Control, hex_color, number_of
from decals.editing.action_state import ActionState
from decals.editing.brushes import Brush, BrushSettings, default_decal_radius, default_radius, positive_number
from decals.editing.commands import SetValues
from decals.editing.document import Document
from decals.errors import InvalidEdit
from decals.field.mapping import ImageMapping
from decals.model import FADE_ANGLES, FADE_DEPTHS, NO_IMAGE, Interaction
from decals.receivers import labels_of
from decals.record import Contact
from decals.scenes.objects import bounds_of
from decals.validation import describe, one_of

PLAIN = "tint alone"
"""Choice of an image that stands for none."""

COLUMNS = {
    "radius": ("radii", "visible radius, in model units"),
    "opacity": ("opacities", "from invisible to opaque"),
    "image": ("images", "image"),
    "tint": ("tints", "colour that multiplies the image"),
    "interaction": ("interactions", "push neighbours, lie above them, or below"),
    "layer": ("layers", "drawn from the lowest up"),
    "spill": ("spill", "also colours surface that faces away"),
    "receivers": ("receivers", "objects that it lies on"),
    "fade_angle": ("fade_angles", "degrees between the normals at which it has faded away; 0: no fade"),
    "fade_depth": (
        "fade_depths",
        "distance from its plane, in radii, at which it has faded away; 0: no fade",
    ),
}
"""Arrays of `decals.Decals` by the names of their controls, and what they mean."""

ANY_OBJECT = "any object"
"""Choice of receivers that stands for all objects."""

MAX_DEPTH = 2.0
"""End of the slider of fade depths, in radii."""

LAYERS = 8
"""Ends of the slider of layers; the field takes any layer."""

MAX_STIFFNESS = 8.0


def decal_controls(document: Document, selection: tuple[int, ...]) -> list[dict[str, Any]]:
    """Return the controls of the selected decals, with the values of the last one."""
    if not selection:
        return []
    last = document.decals[selection[-1]]
    value = {name: getattr(last, array)[0] for name, (array, _) in COLUMNS.items()}
    low, high = bounds_of(document.objects) if document.objects else (np.zeros(3), np.ones(3))
    reach = max(0.25 * float((high - low).max()), float(value["radius"]))
    layers, depth = max(LAYERS, abs(int(value["layer"]))), max(MAX_DEPTH, float(value["fade_depth"]))
    ends = {
        "radius": (reach / STEPS, reach),
        "opacity": (0.0, 1.0),
        "layer": (-layers, layers),
        "fade_angle": (0.0, FADE_ANGLES[1]),
        "fade_depth": (0.0, depth),
    }
    names, receivers = image_names(document), str(value["receivers"])
    others: dict[str, tuple[str, Any, tuple[str, ...]]] = {
        "image": ("choice", names[int(value["image"]) + 1], tuple(names)),
        "tint": ("color", hex_color(tuple(value["tint"].tolist())), ()),
        "interaction": ("choice", Interaction(int(value["interaction"])).name.lower(), _names(Interaction)),
        "spill": ("switch", bool(value["spill"]), ()),
        "receivers": ("choice", receivers or ANY_OBJECT, tuple(receiver_choices(document, receivers))),
    }
    controls = []
    for name, (_, doc) in COLUMNS.items():
        if name in ends:
            step = 1.0 if name == "layer" else None
            controls.append(_slider(name, value[name].item(), *ends[name], doc, step=step))
        else:
            kind, shown, choices = others[name]
            controls.append(Control(name, kind, shown, doc, choices=choices))
    return [asdict(control) for control in controls]


def _slider(name: str, value: float, low: float, high: float, doc: str, step: float | None = None) -> Control:
    return Control(name, "number", value, doc, "", low, high, step or (high - low) / STEPS)


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
        case "radius" | "opacity":
            return number_of(name, raw)
        case "layer":
            return round(number_of(name, raw))
        case "image":
            names = image_names(document)
            return names.index(one_of(name, raw, names, InvalidEdit)) + NO_IMAGE
        case "tint":
            return color_rgb("tint", raw, InvalidEdit)
        case "interaction":
            return int(Interaction[one_of(name, raw, _names(Interaction), InvalidEdit).upper()])
        case "spill":
            return bool(raw)
        case "receivers":
            return "" if raw == ANY_OBJECT else raw
        case "fade_angle" | "fade_depth":
            least = (FADE_ANGLES if name == "fade_angle" else FADE_DEPTHS)[0]
            number = number_of(name, raw)
            return 0.0 if 0.0 <= number < least else number
    raise InvalidEdit(f"value of decals: expected one of {', '.join(COLUMNS)}, got {describe(name)}")


def set_decal_value(state: ActionState, name: str, raw: Any, *, last: bool) -> None:
    """Set a value of all selected decals; moves of a slider are one undo entry."""
    numbers = state.selected_numbers
    value = parsed_decal_value(state.session.document, name, raw)
    label = f"set {name}"
    state.begin_series((label, state.selection), label)
    state.run_latest(SetValues.each(numbers, label, **{COLUMNS[name][0]: value}))
    if last:
        state.end_stroke()


# -- brush and modes ------------------------------------------------------------------------------------


def brush_values(document: Document, brush: BrushSettings) -> dict[str, Any]:
    """Return the brush and its controls; the sizes of brushes need the surface, which selecting does not."""
    if brush.brush in (Brush.SELECT, Brush.BOX, Brush.LASSO, Brush.PULL):
        return {"brush": str(brush.brush), "controls": []}
    has_objects = bool(document.objects)
    radius = brush.radius or (default_radius(document) if has_objects else 1.0)
    size = brush.decal_radius or (default_decal_radius(document) if has_objects else 0.1)
    usual = default_radius(document) if has_objects else 1.0
    reach = max(4.0 * usual, radius)
    controls = [_slider("radius", radius, reach / STEPS, reach, "radius of the brush, in model units")]
    if brush.brush is Brush.SCATTER:
        controls += [
            _slider("decal_radius", size, usual / STEPS, max(usual, size), "radius of new decals"),
            _slider("density", brush.density, 0.05, 1.0, "1 leaves no gaps"),
        ]
    return {"brush": str(brush.brush), "controls": [asdict(control) for control in controls]}


def set_brush(brush: BrushSettings, name: str, raw: Any) -> None:
    """Set the brush, or one of its numbers, to what a page sent."""
    if name == "brush":
        brush.brush = Brush(one_of("brush", raw, list(Brush), InvalidEdit))
        return
    if not isinstance(name, str) or name not in ("radius", "decal_radius", "density"):
        raise InvalidEdit(f"brush: expected 'radius' or such, got {describe(name)}")
    number = positive_number(name, number_of(name, raw))
    if name == "density" and number > 1.0:
        raise InvalidEdit(f"density: expected at most 1, got {number:g}")
    setattr(brush, name, number)


def mode_controls(state: ActionState) -> list[dict[str, Any]]:
    """Return the controls of contact mode, image mapping and stiffness."""
    modes = state.modes
    controls = [
        Control("contact", "choice", modes.contact.name.lower(), "how decals meet", choices=_names(Contact)),
        Control(
            "mapping", "choice", modes.mapping.name.lower(), "how images lie", choices=_names(ImageMapping)
        ),
    ]
    if modes.contact is Contact.ELASTIC:
        reach = max(MAX_STIFFNESS, modes.stiffness)
        controls.append(_slider("stiffness", modes.stiffness, 1.0, reach, "of elastic contact", step=0.1))
    return [asdict(control) for control in controls]


def _names(kind: type[Enum]) -> tuple[str, ...]:
    return tuple(one.name.lower() for one in kind)


def set_mode(state: ActionState, name: str, raw: Any) -> None:
    """Set a mode to what a page sent; errors are those of the window's renderer."""
    parse: dict[str, Callable[[Any], Any]] = {
        "contact": lambda text: text,
        "mapping": lambda text: text,
        "stiffness": lambda raw: number_of("stiffness", raw),
    }
    setattr(state.modes, name, parse[one_of("mode", name, parse, InvalidEdit)](raw))
