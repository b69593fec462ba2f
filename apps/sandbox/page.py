"""The page of the sandbox: a trame user interface around the view of an edit window."""

import asyncio
from contextlib import suppress
from typing import Any

from trame.ui.vuetify3 import VAppLayout
from trame.widgets import html, vuetify3
from trame_pyvista.widgets import PyVistaRemoteView

from decals.apps.sandbox.sandbox import Sandbox
from decals.editing.actions import KEYS
from decals.editing.key_bindings import format_gestures
from decals.window import EditWindow, browser_keys

REFRESH_SECONDS = 0.1
"""Time between two looks at the session, whose changes the page then shows."""

PANEL_WIDTH = 290
TOOLBAR = {
    "undo": "mdi-undo",
    "redo": "mdi-redo",
    "save": "mdi-content-save-outline",
    "export": "mdi-export",
    "duplicate": "mdi-content-duplicate",
    "delete": "mdi-delete-outline",
    "next_contact": "mdi-arrow-collapse-horizontal",
    "help": "mdi-help-circle-outline",
}
"""Icons of the actions in the toolbar."""

ROW_ICONS = (
    "({object: 'mdi-cube-outline', mesh: 'mdi-vector-triangle', combination: 'mdi-set-center', "
    "modifier: 'mdi-tune-variant', primitive: 'mdi-circle-medium', image: 'mdi-image-outline'})[row.kind]"
)
FIELD = {"density": "compact", "variant": "outlined", "hide_details": True}
COMPACT = {"density": "compact", "hide_details": True}


def _label(expression: str) -> list[str]:
    """Return the attribute that tells screen readers what an element is, from an expression of the page."""
    return [f':aria-label="{expression}"']


class Page:
    """The page of one sandbox.

    Parameters
    ----------
    server
        The trame server.
    window
        The edited window; its plotter is drawn off screen.
    """

    def __init__(self, server: Any, window: EditWindow) -> None:
        self._server, self._window = server, window
        self.sandbox = Sandbox(window)
        self._shown: dict[str, Any] = {}
        self._task: asyncio.Task[None] | None = None
        server.state.update({"catalog": self.sandbox.catalog(), "theme": "light", **self.values()})
        self._build()
        server.controller.on_server_ready.add(self._start)
        server.controller.on_server_exited.add(self._stop)

    # -- values -----------------------------------------------------------------------------------------

    def values(self) -> dict[str, Any]:
        """Return all values that the page shows, by their names there."""
        return self.sandbox.values()

    def refresh(self) -> None:
        """Send the values that have changed since the last look."""
        self.sandbox.settle()
        values = self.values()
        changed = {name: value for name, value in values.items() if self._shown.get(name, self) != value}
        self._shown.update(changed)
        if changed:
            with self._server.state:
                self._server.state.update(changed)

    def _start(self, **_: Any) -> None:
        self._task = asyncio.get_running_loop().create_task(self._keep_fresh())

    def _stop(self, **_: Any) -> None:
        if self._task is not None:
            self._task.cancel()

    async def _keep_fresh(self) -> None:
        with suppress(asyncio.CancelledError):
            while True:
                self.refresh()
                await asyncio.sleep(REFRESH_SECONDS)

    # -- layout -----------------------------------------------------------------------------------------

    def _build(self) -> None:
        with VAppLayout(self._server, full_height=True) as layout:
            layout.root.theme = ("theme",)
            with vuetify3.VLayout(full_height=True):
                self._build_toolbar()
                self._build_left_side()
                self._build_right_side()
                with vuetify3.VMain(), html.Div(style="height: 100%", **browser_keys(self._window)):
                    self.view = PyVistaRemoteView(self._window.plotter, style="height: 100%")
                with vuetify3.VFooter(app=True, height=28, classes="text-caption"):
                    html.Span("{{ status }}", raw_attrs=['role="status"'])

    def _build_left_side(self) -> None:
        """Build what stands left of the view."""
        with vuetify3.VNavigationDrawer(permanent=True, width=PANEL_WIDTH, location="left"):
            self._build_outline()

    def _build_right_side(self) -> None:
        """Build what stands right of the view."""
        with vuetify3.VNavigationDrawer(permanent=True, width=PANEL_WIDTH, location="right"):
            self._build_panel()
            self._build_history()

    def _build_toolbar(self) -> None:
        with vuetify3.VAppBar(density="compact", flat=True, border=True):
            vuetify3.VAppBarTitle("{{ title }}")
            self._build_menu("Add", "mdi-plus", "primitives", self.sandbox.add)
            self._build_menu("Modify", "mdi-tune-variant", "modifiers", self.sandbox.wrap)
            self._build_menu("Combine", "mdi-set-center", "combinations", self.sandbox.combine)
            vuetify3.VDivider(vertical=True, classes="mx-2")
            gestures = {binding.action: binding for binding in KEYS.bindings}
            for action, icon in TOOLBAR.items():
                text = f"{gestures[action].summary} ({format_gestures(gestures[action])})"
                vuetify3.VBtn(
                    icon=icon,
                    title=text,
                    raw_attrs=_label(f"'{text}'"),
                    size="small",
                    click=(self.sandbox.perform, f"['{action}']"),
                )
            vuetify3.VBtn(
                icon="mdi-theme-light-dark",
                title="light or dark",
                raw_attrs=_label("'light or dark'"),
                size="small",
                click="theme = theme === 'light' ? 'dark' : 'light'",
            )

    @staticmethod
    def _build_menu(label: str, icon: str, family: str, event: Any) -> None:
        with vuetify3.VMenu(max_height=480):
            with vuetify3.Template(v_slot_activator="{ props }"):
                vuetify3.VBtn(label, v_bind="props", prepend_icon=icon, size="small")
            with vuetify3.VList(density="compact"):
                vuetify3.VListItem(
                    v_for=f"kind in catalog.{family}",
                    key="kind",
                    title=("kind",),
                    click=(event, "[kind]"),
                )

    def _build_outline(self) -> None:
        vuetify3.VListSubheader("Outline", raw_attrs=['role="heading" aria-level="2"'])
        with vuetify3.VList(density="compact", nav=True):
            vuetify3.VListItem(
                v_for="row in outline",
                key="row.key",
                title=("row.label",),
                prepend_icon=(ROW_ICONS,),
                active=("row.key === selected",),
                style=("`padding-left: ${8 + 14 * row.depth}px`",),
                click=(self.sandbox.select, "[row.key === selected ? '' : row.key]"),
            )

    def _build_panel(self) -> None:
        with html.Div(v_if="panel.kind", classes="pa-3"):
            html.H2("{{ panel.kind }}", classes="text-subtitle-1")
            html.P("{{ panel.doc }}", classes="text-caption mb-3")
            with html.Div(v_for="c in panel.controls", key="selected + c.name", classes="mb-3"):
                html.Label(
                    "{{ c.name.replaceAll('_', ' ') }}{{ c.unit ? ', ' + c.unit : '' }}",
                    title=("c.doc",),
                    classes="text-caption",
                )
                self._build_number()
                self._build_other_controls()
            vuetify3.VBtn(
                "Remove this modifier",
                v_if="panel.operands === 1",
                size="small",
                variant="tonal",
                click=self.sandbox.unwrap,
            )
        html.P("Select a node in the outline.", v_if="!panel.kind", classes="pa-3 text-caption")

    def _build_number(self) -> None:
        with html.Div(v_if="c.kind === 'number'", classes="d-flex align-center"):
            vuetify3.VSlider(
                model_value=("c.value",),
                min=("c.low",),
                max=("c.high",),
                step=("c.step",),
                name=("c.name.replaceAll('_', ' ')",),
                update_modelValue=(self.sandbox.set_value, "[c.name, $event, false]"),
                end=(self.sandbox.set_value, "[c.name, $event, true]"),
                **COMPACT,
            )
            vuetify3.VTextField(
                model_value=("c.value === null ? '' : Number(c.value.toPrecision(5))",),
                raw_attrs=_label("c.name.replaceAll('_', ' ')"),
                style="max-width: 92px",
                change=(self.sandbox.set_value, "[c.name, $event.target.value, true]"),
                **FIELD,
            )

    def _build_other_controls(self) -> None:
        with html.Div(v_if="c.kind === 'vector'", classes="d-flex ga-1"):
            vuetify3.VTextField(
                v_for="(number, i) in c.value",
                key="i",
                model_value=("Number(number.toPrecision(5))",),
                raw_attrs=_label("`${c.name} ${i + 1}`"),
                change=(self.sandbox.set_component, "[c.name, [i], $event.target.value]"),
                **FIELD,
            )
        with (
            html.Div(v_if="c.kind === 'list'"),
            html.Div(v_for="(row, i) in c.value", key="i", classes="d-flex ga-1 mb-1"),
        ):
            vuetify3.VTextField(
                v_for="(number, j) in [].concat(row)",
                key="j",
                model_value=("Number(number.toPrecision(5))",),
                raw_attrs=_label("`${c.name} ${i + 1} ${j + 1}`"),
                change=(
                    self.sandbox.set_component,
                    "[c.name, Array.isArray(row) ? [i, j] : [i], $event.target.value]",
                ),
                **FIELD,
            )
        html.Input(
            v_if="c.kind === 'color'",
            type="color",
            value=("c.value",),
            raw_attrs=_label("c.name.replaceAll('_', ' ')"),
            style="width: 100%; height: 28px",
            change=(self.sandbox.set_value, "[c.name, $event.target.value, true]"),
        )
        vuetify3.VSelect(
            v_if="c.kind === 'choice'",
            model_value=("c.value",),
            items=("c.choices",),
            raw_attrs=_label("c.name.replaceAll('_', ' ')"),
            update_modelValue=(self.sandbox.set_value, "[c.name, $event, true]"),
            **FIELD,
        )
        html.Div("{{ c.value }}", v_if="c.kind === 'text'", classes="text-caption")

    def _build_history(self) -> None:
        vuetify3.VDivider()
        vuetify3.VListSubheader("History", raw_attrs=['role="heading" aria-level="2"'])
        with vuetify3.VList(density="compact"):
            vuetify3.VListItem(
                title="Start",
                active=("done.length === 0",),
                click=(self.sandbox.go_to, "[0]"),
            )
            vuetify3.VListItem(
                v_for="(entry, i) in done.concat(undone)",
                key="i",
                title=("entry",),
                active=("i === done.length - 1",),
                classes=("i < done.length ? '' : 'text-disabled'",),
                click=(self.sandbox.go_to, "[i + 1]"),
            )
