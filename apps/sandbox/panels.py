"""Parts of the sandbox's page beside outline and history: start, files, view, brushes, decals, actions."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from trame.widgets import html, vuetify3

from decals.apps.sandbox.files import LIGHT
from decals.apps.sandbox.sandbox import Sandbox
from decals.editing.actions import KEYS
from decals.editing.brush_settings import Brush
from decals.editing.key_bindings import CAMERA, Binding, Group, format_gestures
from decals.editing.view_actions import SIDE_KEYS

COMPACT = {"density": "compact", "hideDetails": True}
OUTLINED = {**COMPACT, "variant": "outlined"}
DEFAULTS = {
    "VBtn": {"size": "small"},
    "VList": {"density": "compact"},
    "VSlider": COMPACT,
    "VSwitch": COMPACT,
    "VCheckbox": COMPACT,
    "VTextField": OUTLINED,
    "VSelect": OUTLINED,
    "VMenu": {"transition": False},
}
"""How elements look unless they say otherwise.

Menus do not grow when they open: the list of a `VSelect` in one would change its width while it measures it.
"""

BRUSH_ICONS = {
    Brush.SELECT: "mdi-cursor-default-outline",
    Brush.ADD: "mdi-plus-circle-outline",
    Brush.BOX: "mdi-selection-drag",
    Brush.LASSO: "mdi-lasso",
    Brush.PAINT: "mdi-brush-variant",
    Brush.PULL: "mdi-hand-back-right-outline",
    Brush.SCATTER: "mdi-spray",
    Brush.PUSH: "mdi-gesture-swipe",
    Brush.ERASE: "mdi-eraser",
    Brush.RELAX: "mdi-dots-hexagon",
    Brush.ALIGN: "mdi-arrow-right-bold-outline",
}
NOT_LISTED = CAMERA, "move", "close", "select", "select_further", "select_also", "toggle"
"""Actions that need the pointer, or that the page has elsewhere."""

SUMMARIES = {b.action: f"{b.summary} ({format_gestures(b)})" for b in KEYS.bindings}
"""What each action does, and its keys."""

TEMPLATES = {
    path.stem: path.read_text(encoding="utf-8") for path in sorted(Path(__file__).parent.glob("*.html"))
}
"""Parts of the page in HTML, by their names."""


def template(name: str, **words: str) -> None:
    """Build a part of the page, with words in the place of others, whose elements are those of its parent."""
    text = re.sub("|".join(words) or "$^", lambda found: words[found[0]], TEMPLATES[name])
    html.Div(text, style="display: contents")


def named(expression: str) -> list[str]:
    """Return the attribute that names an element for screen readers, from an expression of the page."""
    return [f':aria-label="{expression}"']


def icon_button(icon: str, text: str, click: Any, **options: Any) -> None:
    """Build a button with an icon and a tooltip."""
    options = {"density": "comfortable", **options}
    vuetify3.VBtn(icon=icon, title=text, raw_attrs=named(f"'{text}'"), click=click, **options)


@contextmanager
def menu(text: str, icon: str, **options: Any) -> Iterator[None]:
    """Build a button that opens a menu with what is built inside."""
    with vuetify3.VMenu(**options):
        with vuetify3.Template(v_slot_activator="{ props }"):
            vuetify3.VBtn(text, v_bind="props", prepend_icon=icon)
        yield


def build_controls(source: str, event: Any, identifiers: str, *, key: str = "c.name") -> None:
    """Build labels and inputs of controls; see `decals.apps.sandbox.controls.Control`.

    Parameters
    ----------
    source
        The list of controls, an expression of the page.
    event
        Receives what identifies the control, its value, and False while a slider moves; then, for one number
        of a vector or a list, the indices of that number.
    identifiers
        Arguments that identify the control ``c``, as expressions of the page.
    key
        Expression that distinguishes the control from those of another selection.
    """
    with html.Div(style="display: contents") as parent:
        name = parent.server.trigger_name(event)
        template("controls", SOURCE=source, EVENT=name, IDENTIFIERS=identifiers, KEY=key)


# -- view -----------------------------------------------------------------------------------------------


def build_view_menu(sandbox: Sandbox) -> None:
    """Build the menu of modes, overlays, slices and cameras."""
    moves = {"Frame selection, or all": "frame", **{side: f"view_{side}" for side in SIDE_KEYS}}
    with (
        menu("View", "mdi-eye-outline", close_on_content_click=False, max_height=640),
        vuetify3.VCard(width=320, classes="pa-3"),
    ):
        build_controls("display.controls", sandbox.set_control, "'display', c.name")
        with html.Div(classes="d-flex flex-wrap ga-1 my-2"):
            for text, action in moves.items():
                perform = sandbox.perform, f"['{action}']"
                vuetify3.VBtn(text, title=SUMMARIES[action], size="x-small", click=perform)
            template("bookmarks")


# -- decals ---------------------------------------------------------------------------------------------


def build_brushes(sandbox: Sandbox) -> None:
    """Build the choice of brushes."""
    with vuetify3.VBtnToggle(
        model_value=("brush.brush",),
        mandatory=True,
        density="compact",
        update_modelValue=(sandbox.set_control, "['brush', 'brush', $event]"),
        raw_attrs=['aria-label="brush"'],
    ):
        for brush in Brush:
            vuetify3.VBtn(
                value=str(brush),
                icon=BRUSH_ICONS[brush],
                width=31,
                title=SUMMARIES[f"brush_{brush}"],
                raw_attrs=named(f"'{SUMMARIES[f'brush_{brush}']}'"),
            )


def build_decal_panel(sandbox: Sandbox) -> None:
    """Build the panels of the brush, the selected decals, the selected image, and the drawing."""
    for panel, values, shown, title in (
        ("brush", "brush", "brush.controls.length", "{{ brush.brush }} brush"),
        ("decals", "decal", "decal.count", "{{ decal.count === 1 ? 'Decal' : decal.count + ' decals' }}"),
        ("image", "image", "image.name", "Image {{ image.name }}"),
    ):
        with html.Div(v_if=shown, classes="pa-3"):
            html.H2(title, classes="text-subtitle-1")
            if panel == "image":
                html.Img(src=("image.picture",), alt="", style="width: 50%; border-radius: 50%")
                template("file_input", TEXT="replace this image", KEY="selected")
            build_controls(f"{values}.controls", sandbox.set_control, f"'{panel}', c.name")


def build_options(sandbox: Sandbox) -> None:
    """Build the panels, closed at first, of scattering and of the drawing."""
    with vuetify3.VExpansionPanels(v_if="outline.length > 1", multiple=True, flat=True, elevation=0):
        for panel in ("scattering", "drawing"):
            with vuetify3.VExpansionPanel(title=panel.capitalize()), vuetify3.VExpansionPanelText():
                build_controls(panel, sandbox.set_control, f"'{panel}', c.name")
                if panel == "drawing":
                    _build_light(sandbox)


def _build_light(sandbox: Sandbox) -> None:
    """Build the inputs that load and remove the panorama that lights the scene."""
    template("file_input", TEXT="light from a panorama", KEY=f"'{LIGHT}'")
    present = "drawing.some(c => c.name.startsWith('environment.'))"
    vuetify3.VBtn("Remove this light", v_if=present, variant="tonal", click=sandbox.remove_light)


def build_actions(sandbox: Sandbox) -> None:
    """Build the menu of all actions, with their keys, by group."""
    shown = {"model_value": ("help && driving.drives",), "update_modelValue": (sandbox.show_help, "[$event]")}
    with menu("Actions", "mdi-keyboard-outline", max_height=560, width=360, **shown), vuetify3.VList():
        for group in Group:
            bindings = [binding for binding in KEYS.bindings if _offered(binding, group)]
            if bindings:
                vuetify3.VListSubheader(group.value)
            for binding in bindings:
                vuetify3.VListItem(
                    title=binding.summary,
                    subtitle=format_gestures(binding),
                    click=(sandbox.perform, f"['{binding.action}']"),
                )


def _offered(binding: Binding, group: Group) -> bool:
    return binding.group is group and binding.action not in NOT_LISTED
