"""Parts of the sandbox's page beside outline and history: start, files, view, brushes, decals, actions."""

from typing import Any

from trame.widgets import html, vuetify3

from decals.apps.sandbox.folder import IMAGES, MODELS
from decals.apps.sandbox.sandbox import Sandbox
from decals.editing.actions import KEYS
from decals.editing.brushes import Brush
from decals.editing.file_actions import Video
from decals.editing.key_bindings import CAMERA, Binding, Group, format_gestures
from decals.editing.view_actions import SIDE_KEYS

FIELD = {"density": "compact", "variant": "outlined", "hide_details": True}
COMPACT = {"density": "compact", "hide_details": True}

BRUSH_ICONS = {
    Brush.SELECT: "mdi-cursor-default-outline",
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
SUMMARIES = {b.action: f"{b.summary} ({format_gestures(b)})" for b in KEYS.bindings}
"""What each action does, and its keys."""

WORDS = "c.name.replaceAll(/[_.]/g, ' ')"
"""Name of the control ``c`` in words."""

CURVE = """<svg viewBox="-0.02 -0.02 1.04 1.04" preserveAspectRatio="none"
  style="width: 100%; height: 48px"><polyline :points="c.curve" fill="none" stroke="currentColor"
  stroke-width="2" vector-effect="non-scaling-stroke"/></svg>"""
"""The curve of the control ``c``."""

DROP = "dropped = Array.from($event.{}.files)"
"""Send files to the state of the page, which turns them into names and bytes."""


def named(expression: str) -> list[str]:
    """Return the attribute that tells screen readers what an element is, from an expression of the page."""
    return [f':aria-label="{expression}"']


def icon_button(icon: str, text: str, click: Any, **options: Any) -> None:
    """Build a button with an icon and a tooltip."""
    options = {"size": "small", "density": "comfortable", **options}
    vuetify3.VBtn(icon=icon, title=text, raw_attrs=named(f"'{text}'"), click=click, **options)


def build_controls(source: str, event: Any, *, who: str = "c.name", key: str = "c.name") -> None:
    """Build labels and inputs of controls; see `decals.apps.sandbox.controls.Control`.

    Parameters
    ----------
    source
        The list of controls, an expression of the page.
    event
        Receives what identifies the control, its value, and False while a slider moves; then, for one number
        of a vector or a list, the indices of that number.
    who
        Expression of what identifies the control ``c``.
    key
        Expression that tells the control from those of another selection.
    """
    with html.Div(v_for=f"c in {source}", key=key, classes="mb-2"):
        html.Label(
            f"{{{{ {WORDS} }}}}{{{{ c.unit ? ', ' + c.unit : '' }}}}",
            v_if="c.kind !== 'switch'",
            title=("c.doc",),
            classes="text-caption",
        )
        with html.Div(v_if="c.kind === 'number' || c.kind === 'field'", classes="d-flex align-center"):
            vuetify3.VSlider(
                v_if="c.kind === 'number'",
                model_value=("c.value",),
                min=("c.low",),
                max=("c.high",),
                step=("c.step",),
                name=(WORDS,),
                update_modelValue=(event, f"[{who}, $event, false]"),
                end=(event, f"[{who}, $event, true]"),
                **COMPACT,
            )
            _number_field("c.value", WORDS, event, f"[{who}, $event.target.value, true]", "max-width: 84px")
        with html.Div(v_if="c.kind === 'vector'", classes="d-flex ga-1"):
            sent = f"[{who}, $event.target.value, true, [i]]"
            label = f"`${{{WORDS}}} ${{i + 1}}`"
            _number_field("number", label, event, sent, v_for="(number, i) in c.value", key="i")
        with (
            html.Div(v_if="c.kind === 'list'"),
            html.Div(v_for="(row, i) in c.value", key="i", classes="d-flex ga-1 mb-1"),
        ):
            sent = f"[{who}, $event.target.value, true, Array.isArray(row) ? [i, j] : [i]]"
            label = f"`${{{WORDS}}} ${{i + 1}} ${{j + 1}}`"
            _number_field("number", label, event, sent, v_for="(number, j) in [].concat(row)", key="j")
        html.Input(
            v_if="c.kind === 'color'",
            type="color",
            value=("c.value",),
            raw_attrs=named(WORDS),
            style="width: 100%; height: 28px",
            change=(event, f"[{who}, $event.target.value, true]"),
        )
        vuetify3.VSelect(
            v_if="c.kind === 'choice'",
            model_value=("c.value",),
            items=("c.choices",),
            raw_attrs=named(WORDS),
            update_modelValue=(event, f"[{who}, $event, true]"),
            **FIELD,
        )
        html.Div(CURVE, v_if="c.curve")
        vuetify3.VSwitch(
            v_if="c.kind === 'switch'",
            model_value=("c.value",),
            label=(WORDS,),
            title=("c.doc",),
            update_modelValue=(event, f"[{who}, $event, true]"),
            color="primary",
            **COMPACT,
        )
        html.Div("{{ c.value }}", v_if="c.kind === 'text'", classes="text-caption")


def _number_field(value: str, label: str, event: Any, sent: str, style: str = "", **options: Any) -> None:
    """Build a field for a number, or for nothing.

    What was refused goes away: a refusal turns the value into another type, so that the field takes it anew.
    """
    number = f"typeof {value} === 'number' ? Number({value}.toPrecision(5)) : null"
    vuetify3.VTextField(
        model_value=(f"(n => refusals % 2 ? n : String(n ?? ''))({number})",),
        raw_attrs=named(label),
        style=style,
        change=(event, sent),
        **options,
        **FIELD,
    )


# -- start page and files -------------------------------------------------------------------------------


def build_start(sandbox: Sandbox) -> None:
    """Build the start page: new model, samples, recent files, recovered sessions and lessons."""
    with (
        vuetify3.VDialog(
            model_value=("start.open",),
            update_modelValue=(sandbox.show_start, "[$event]"),
            max_width=860,
            raw_attrs=['aria-label="start"'],
        ),
        vuetify3.VCard(title="Sandbox", subtitle="Model, and cover models with decals."),
        vuetify3.VCardText(),
    ):
        with html.Div(classes="d-flex flex-wrap ga-3 mb-4"):
            _start_tile("mdi-plus", "New model", sandbox.new_model)
            with (
                html.Div(v_for="name in start.samples", key="name"),
                vuetify3.VCard(
                    width=140,
                    variant="outlined",
                    click=(sandbox.open_sample, "[name]"),
                    raw_attrs=named("'sample ' + name"),
                ),
            ):
                vuetify3.VImg(src=("thumbnails[name]",), height=88, cover=True, alt="")
                html.Div("{{ name }}", classes="text-caption text-center pa-1")
        _build_open_file()
        for family, title, event in (
            ("recovered", "Recovered sessions", sandbox.open_file),
            ("recent", "Files in this folder", sandbox.open_file),
        ):
            with html.Div(v_if=f"start.{family}.length", classes="mt-4"):
                html.H2(title, classes="text-subtitle-2")
                with vuetify3.VList(density="compact"):
                    vuetify3.VListItem(
                        v_for=f"file in start.{family}",
                        key="file.name",
                        title=("file.name",),
                        subtitle=("file.when",),
                        click=(event, "[file.name]"),
                    )
        with html.Div(v_if="start.lessons.length", classes="mt-4"):
            html.H2("Lessons", classes="text-subtitle-2")
            with vuetify3.VList(density="compact"):
                vuetify3.VListItem(
                    v_for="(lesson, i) in start.lessons",
                    key="i",
                    title=("lesson",),
                    click=(sandbox.open_lesson, "[i]"),
                )


def _start_tile(icon: str, text: str, click: Any) -> None:
    with vuetify3.VCard(width=140, variant="outlined", click=click, raw_attrs=named(f"'{text}'")):
        with html.Div(classes="d-flex align-center justify-center", style="height: 88px"):
            vuetify3.VIcon(icon, size=40)
        html.Div(text, classes="text-caption text-center pa-1")


def _build_open_file() -> None:
    html.Label("Open from this computer (or drop files on the view): ", classes="text-caption")
    html.Input(
        type="file",
        multiple=True,
        accept=",".join(MODELS + IMAGES),
        raw_attrs=named("'open from this computer'"),
        change=DROP.format("target"),
    )


def build_files(sandbox: Sandbox) -> None:
    """Build the menu that writes files: scene, script, mesh and picture by the suffix of the name."""
    with vuetify3.VMenu(close_on_content_click=False):
        with vuetify3.Template(v_slot_activator="{ props }"):
            vuetify3.VBtn("File", v_bind="props", prepend_icon="mdi-file-outline", size="small")
        with vuetify3.VCard(width=340, classes="pa-3"):
            vuetify3.VBtn(
                "Open or new ...", size="small", variant="tonal", click=(sandbox.show_start, "[true]")
            )
            html.P(
                "Save or export. The ending is the format: .json scene, .py script, "
                ".ply .stl .obj .vtp mesh, .glb mesh with the decals, .png .jpg picture, .gif .mp4 video.",
                classes="text-caption mt-3 mb-1",
            )
            with html.Div(classes="d-flex ga-2 align-center"):
                write = sandbox.write_file, "[file_name, replace_file, file_size, file_video]"
                vuetify3.VTextField(
                    v_model=("file_name", ""),
                    placeholder="model.stl",
                    raw_attrs=named("'file name'"),
                    enter=write,
                    __events=[("enter", "keyup.enter")],
                    **FIELD,
                )
                vuetify3.VBtn("Write", size="small", click=write)
            vuetify3.VTextField(
                v_if="/(png|jpg|gif|mp4)$/i.test(file_name)",
                v_model=("file_size", ""),
                label="size, such as 1920 x 1080",
                classes="mt-2",
                **FIELD,
            )
            vuetify3.VSelect(
                v_if="/(gif|mp4)$/i.test(file_name)",
                v_model=("file_video", "turntable"),
                items=("videos", list(map(str, Video))),
                label="video",
                classes="mt-2",
                **FIELD,
            )
            vuetify3.VCheckbox(v_model=("replace_file", False), label="replace a file that exists", **COMPACT)


def build_driver() -> None:
    """Build who drives a shared page, and the button that asks for control or passes it."""
    with html.Div(v_if="driving.shared", classes="d-flex align-center ga-2 mr-2"):
        html.Span(
            "{{ driving.drives ? 'You drive' : 'Browser ' + driving.driver + ' drives' }}, "
            "{{ driving.browsers - 1 }} watch",
            classes="text-caption",
            raw_attrs=['role="status"'],
        )
        vuetify3.VBtn(
            "Pass control to browser {{ driving.next }}",
            v_if="driving.drives && driving.next",
            size="small",
            variant="tonal",
            click="trigger('pass_control')",
        )
        vuetify3.VBtn(
            "{{ driving.asks ? 'Asked for control' : 'Ask for control' }}",
            v_if="!driving.drives",
            disabled=("driving.asks",),
            size="small",
            variant="tonal",
            click="trigger('ask_to_drive')",
        )


# -- view -----------------------------------------------------------------------------------------------


def build_view_menu(sandbox: Sandbox) -> None:
    """Build the menu of modes, overlays, slices and cameras."""
    with vuetify3.VMenu(close_on_content_click=False, max_height=640):
        with vuetify3.Template(v_slot_activator="{ props }"):
            vuetify3.VBtn("View", v_bind="props", prepend_icon="mdi-eye-outline", size="small")
        with vuetify3.VCard(width=320, classes="pa-3"):
            build_controls("display.controls", sandbox.set_display)
            with html.Div(classes="d-flex flex-wrap ga-1 my-2"):
                for text, action in {
                    "Frame selection, or all": "frame",
                    **{s: f"view_{s}" for s in SIDE_KEYS},
                }.items():
                    perform = sandbox.perform, f"['{action}']"
                    vuetify3.VBtn(text, title=SUMMARIES[action], size="x-small", click=perform)
            with html.Div(classes="d-flex flex-wrap ga-1"):
                vuetify3.VBtn("Keep this view", size="x-small", click=(sandbox.move_camera, "['keep']"))
                vuetify3.VBtn(
                    "{{ name }}",
                    v_for="(name, i) in display.bookmarks",
                    key="name",
                    size="x-small",
                    click=(sandbox.move_camera, "['go', i]"),
                )


# -- decals ---------------------------------------------------------------------------------------------


def build_brushes(sandbox: Sandbox) -> None:
    """Build the choice of brushes."""
    with vuetify3.VBtnToggle(
        model_value=("brush.brush",),
        mandatory=True,
        density="compact",
        update_modelValue=(sandbox.set_brush, "['brush', $event]"),
        raw_attrs=['aria-label="brush"'],
    ):
        for brush in Brush:
            vuetify3.VBtn(
                value=str(brush),
                icon=BRUSH_ICONS[brush],
                size="small",
                width=34,
                title=SUMMARIES[f"brush_{brush}"],
                raw_attrs=named(f"'{SUMMARIES[f'brush_{brush}']}'"),
            )


def build_decal_panel(sandbox: Sandbox) -> None:
    """Build the panels of the brush, the selected decals, the selected image, and the drawing."""
    for shown, title, source, event in (
        ("brush.controls.length", "{{ brush.brush }} brush", "brush.controls", sandbox.set_brush),
        (
            "decal.count",
            "{{ decal.count === 1 ? 'Decal' : decal.count + ' decals' }}",
            "decal.controls",
            sandbox.set_decals,
        ),
        ("image.name", "Image {{ image.name }}", "image.controls", sandbox.set_image),
    ):
        with html.Div(v_if=shown, classes="pa-3"):
            html.H2(title, classes="text-subtitle-1")
            if source == "image.controls":
                html.Img(src=("image.picture",), alt="", style="width: 50%; border-radius: 50%")
            build_controls(source, event)


def build_options(sandbox: Sandbox) -> None:
    """Build the panels, closed at first, of scattering and of the drawing."""
    with vuetify3.VExpansionPanels(v_if="outline.length > 1", multiple=True, flat=True, elevation=0):
        for title, source, event in (
            ("Scattering", "scattering", sandbox.set_scattering),
            ("Drawing", "drawing", sandbox.set_drawing),
        ):
            with vuetify3.VExpansionPanel(title=title), vuetify3.VExpansionPanelText():
                build_controls(source, event)


def build_scatter(sandbox: Sandbox) -> None:
    """Build the button that covers an object with decals."""
    with html.Div(v_if="outline.length > 1", classes="d-flex align-center ga-2 px-3 pt-3"):
        vuetify3.VBtn(
            "{{ decals ? 'Scatter again' : 'Scatter decals' }}",
            size="small",
            variant="tonal",
            click=sandbox.scatter,
        )


def build_pick() -> None:
    """Build the report of the last click."""
    with html.Div(v_if="Object.keys(pick).length", classes="pa-3 text-caption"):
        html.H2("Last click", classes="text-subtitle-1")
        html.Div("{{ name }}: {{ text }}", v_for="(text, name) in pick", key="name")


def build_actions(sandbox: Sandbox) -> None:
    """Build the menu of all actions, with their keys, by group."""
    with vuetify3.VMenu(max_height=560):
        with vuetify3.Template(v_slot_activator="{ props }"):
            vuetify3.VBtn("Actions", v_bind="props", prepend_icon="mdi-keyboard-outline", size="small")
        with vuetify3.VList(density="compact"):
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
    return binding.group is group and binding.action not in (CAMERA, "move", "close", "select", "select_also")
