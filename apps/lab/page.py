"""The page of the contact lab: the sandbox with a lesson on the left and its plots on the right."""

from collections.abc import Sequence
from typing import Any

from trame.widgets import client, html, vuetify3

from decals.apps.lab.lab import Lab
from decals.apps.lab.lesson import Lesson
from decals.apps.sandbox.page import Page
from decals.apps.sandbox.panels import COMPACT, FIELD, icon_button, named
from decals.window import EditWindow

LESSON_WIDTH, PLOTS_WIDTH = 330, 350

STYLE = """
.lesson { font-size: 0.85rem; line-height: 1.35 }
.lesson p, .lesson ul, .lesson ol, .lesson table { margin-bottom: 6px }
.lesson ul, .lesson ol { padding-left: 20px }
.answer .v-alert__content { color: rgb(var(--v-theme-on-surface)) }
.lesson td, .lesson th { padding-right: 10px; text-align: left }
"""
"""How the text of a lesson looks."""


class LabPage(Page):
    """A page of the sandbox with lessons.

    Parameters
    ----------
    server, window
        As for `Page`.
    lessons
        The lessons.
    """

    def __init__(self, server: Any, window: EditWindow, lessons: Sequence[Lesson]) -> None:
        self.lab = Lab(window, lessons)
        server.state.lab_side = "plots"
        super().__init__(server, window)
        server.controller.on_server_exited.add(lambda **_: self.lab.close())

    def values(self) -> dict[str, Any]:
        """Return all values that the page shows, by their names there."""
        self.lab.refresh()
        return {**super().values(), **self.lab.values()}

    def _build_left_side(self) -> None:
        with vuetify3.VNavigationDrawer(permanent=True, width=LESSON_WIDTH, location="left"):
            client.Style(STYLE)
            with html.Div(classes="pa-3"):
                with html.Div(classes="d-flex align-center ga-1 mb-2"):
                    vuetify3.VSelect(
                        model_value=("lab_number",),
                        items=("lab_titles",),
                        raw_attrs=named("'lesson'"),
                        update_modelValue=(self.lab.start, "[$event]"),
                        **FIELD,
                    )
                    icon_button("mdi-restart", "start the lesson again", (self.lab.start, "[lab_number]"))
                html.Div(v_html=("lab_text",), classes="lesson")
                self._build_question()
                self._build_sliders()

    def _build_sliders(self) -> None:
        with html.Div(v_for="s in lab_sliders", key="lab_number + s.label", classes="mb-1"):
            html.Div("{{ s.label }}", classes="text-caption")
            with html.Div(v_if="!s.choices.length", classes="d-flex align-center"):
                vuetify3.VSlider(
                    model_value=("s.value",),
                    min=("s.low",),
                    max=("s.high",),
                    step=("s.step",),
                    name=("s.label",),
                    update_modelValue=(self.lab.set_value, "[s.number, $event, false]"),
                    end=(self.lab.set_value, "[s.number, $event, true]"),
                    **COMPACT,
                )
                vuetify3.VTextField(
                    model_value=("typeof s.value === 'number' ? Number(s.value.toPrecision(3)) : ''",),
                    raw_attrs=named("s.label"),
                    style="max-width: 84px",
                    change=(self.lab.set_value, "[s.number, $event.target.value, true]"),
                    **FIELD,
                )
            vuetify3.VSelect(
                v_if="s.choices.length",
                model_value=("s.value",),
                items=("s.choices",),
                raw_attrs=named("s.label"),
                update_modelValue=(self.lab.set_value, "[s.number, $event, true]"),
                **FIELD,
            )

    @staticmethod
    def _build_values() -> None:
        with html.Table(v_if="lab_values.length", classes="mb-2 text-caption", style="width: 100%"):  # noqa: SIM117  (one level of HTML a line)
            with html.Tr(v_for="v in lab_values", key="v.label"):
                html.Td("{{ v.label }}")
                html.Td("{{ v.text }}", style="text-align: right; font-variant-numeric: tabular-nums")

    def _build_question(self) -> None:
        with vuetify3.VSheet(border=True, rounded=True, classes="pa-2 my-2"):
            html.Div("{{ lab_question }}", classes="lesson font-weight-medium mb-2")
            vuetify3.VBtn("Check the answer", size="small", color="primary", click=self.lab.check)
            vuetify3.VAlert(
                "{{ lab_verdict.text }}",
                v_if="lab_verdict.text",
                type=("lab_verdict.right ? 'success' : 'warning'",),
                raw_attrs=['role="status"'],
                variant="outlined",
                density="compact",
                classes="mt-3 lesson answer",
            )

    def _build_right_side(self) -> None:
        with vuetify3.VNavigationDrawer(permanent=True, width=PLOTS_WIDTH, location="right"):
            with vuetify3.VBtnToggle(
                v_model="lab_side", mandatory=True, density="compact", variant="text", classes="mx-2 mt-1"
            ):
                vuetify3.VBtn("Plots", value="plots", size="small")
                vuetify3.VBtn("Model", value="model", size="small")
            with html.Div(v_show="lab_side === 'plots'", classes="px-2 pb-2"):
                self._build_values()
                with html.Div(v_for="p in lab_plots", key="p.title", classes="mb-2"):
                    html.Div("{{ p.title }}", classes="text-body-2 font-weight-medium")
                    html.Div(v_html=("p.svg",))
                    html.Div("{{ p.note }}", classes="text-caption")
            with html.Div(v_show="lab_side === 'model'"):
                self._build_outline()
                self._build_panels()
