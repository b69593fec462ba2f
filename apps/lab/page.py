"""The page of the contact lab: the sandbox with a lesson on the left and its plots on the right."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from trame.widgets import client, html, vuetify3

from decals.apps.lab.lab import Lab
from decals.apps.lab.lesson import Lesson
from decals.apps.lab.symbols import LIT
from decals.apps.sandbox.page import PANEL_WIDTH, Page, drawer
from decals.apps.sandbox.panels import build_controls, icon_button, named
from decals.window import EditWindow

LESSON_WIDTH, PLOTS_WIDTH = 330, 350

STYLE = Path(__file__).with_name("page.css").read_text(encoding="utf-8") + f"{LIT} {{ stroke-width: 5 }}"


class LabPage(Page):
    """A page of the sandbox with lessons.

    Parameters
    ----------
    server, window
        As for `Page`.
    lessons
        The lessons.
    in_lesson
        Begin with the first lesson.
    options
        Options of the `Sandbox`.
    """

    def __init__(
        self,
        server: Any,
        window: EditWindow,
        lessons: Sequence[Lesson],
        *,
        in_lesson: bool = True,
        **options: Any,
    ) -> None:
        self.lab = Lab(window, lessons)
        server.state.update({"lab_side": "plots", "lab_script": "", **self.lab.values()})
        titles = [lesson.settings.title for lesson in lessons]
        super().__init__(server, window, lessons=titles, start_lesson=self.lab.start, **options)
        if in_lesson:
            self.sandbox.open_lesson(0)
        server.controller.on_server_exited.add(lambda **_: self.lab.close())

    def values(self) -> dict[str, Any]:
        """Return all values that the page shows, by their names there."""
        in_lesson = self.sandbox.in_lesson
        points = {"probe": (self.lab.probe, self.lab.move_probe)} if in_lesson else {}
        self.sandbox.display.points = points
        values = {**super().values(), "in_lesson": in_lesson}
        if in_lesson:
            self.lab.refresh()
            values |= {**self.lab.values(), "title": self.lab.lesson.settings.title, "left_open": True}
        elif self._shown.get("in_lesson"):
            self.lab.leave()
        return values

    def _build_left_side(self) -> None:
        with drawer("left", f"(in_lesson ? {LESSON_WIDTH} : {PANEL_WIDTH})"):
            client.Style(STYLE)
            with html.Div(v_if="!in_lesson"):
                self._build_outline()
            with html.Div(v_if="in_lesson", classes="pa-3 lesson-side"):
                with html.Div(classes="d-flex align-center ga-1 mb-2"):
                    vuetify3.VSelect(
                        model_value=("lab_number",),
                        items=("lab_titles",),
                        raw_attrs=named("'lesson'"),
                        update_modelValue=(self._restart, "[$event]"),
                    )
                    icon_button("mdi-restart", "start the lesson again", (self._restart, "[lab_number]"))
                    icon_button("mdi-language-python", "lines of Python for this picture", self._show_script)
                    keep = self.sandbox.close_lesson, "[true]"
                    icon_button("mdi-open-in-app", "open in the sandbox", keep)
                    icon_button("mdi-close", "leave the lesson", self.sandbox.close_lesson)
                self._build_script()
                html.Div(v_html=("lab_text",), classes="lesson", tabindex=0)
                self._build_question()
                build_controls("lab_sliders", self._set_value, "c.number", key="lab_number + c.name")

    def _show_script(self) -> None:
        """Show the lines of Python that make the present picture."""
        self.sandbox.attempt(lambda: self._server.state.update({"lab_script": self.lab.script()}))

    def _build_script(self) -> None:
        with (
            vuetify3.VDialog(
                model_value=("!!lab_script",), update_modelValue="lab_script = ''", max_width=860
            ),
            vuetify3.VCard(title="Lines of Python for this picture"),
            vuetify3.VCardText(),
        ):
            html.Pre("{{ lab_script }}", classes="script", tabindex=0)
            vuetify3.VBtn("Copy", color="primary", click="utils.sandbox.copy(lab_script)")

    def _restart(self, number: int) -> None:
        """Start a lesson from its beginning."""
        self.sandbox.attempt(lambda: self.lab.start(number))

    def _set_value(self, number: int, raw: Any, last: bool = True) -> None:
        """Set what a slider of the lesson moves."""
        self.sandbox.slide(lambda: self.lab.set_value(number, raw, last), last=bool(last))

    def _build_question(self) -> None:
        with vuetify3.VSheet(border=True, rounded=True, classes="pa-2 my-2"):
            html.Div(v_html=("lab_question",), classes="lesson font-weight-medium mb-2")
            vuetify3.VBtn("Check the answer", color="primary", click=self.lab.check)
            with vuetify3.VAlert(
                v_if="lab_verdict.text",
                type=("lab_verdict.right ? 'success' : 'warning'",),
                raw_attrs=['role="status"'],
                variant="outlined",
                density="compact",
                classes="mt-3 lesson answer",
            ):
                html.Div(v_html=("lab_verdict.text",))

    def _build_right_side(self) -> None:
        with drawer("right", f"(in_lesson ? {PLOTS_WIDTH} : {PANEL_WIDTH})"):
            with vuetify3.VBtnToggle(
                v_if="in_lesson",
                v_model="lab_side",
                mandatory=True,
                density="compact",
                variant="text",
                classes="mx-2 mt-1",
            ):
                vuetify3.VBtn("Plots", value="plots")
                vuetify3.VBtn("Model", value="model")
            with html.Div(v_if="in_lesson && lab_side === 'plots'", classes="px-2 pb-2 plots"):
                with html.Table(v_if="lab_values.length", classes="mb-2 text-caption", style="width: 100%"):  # noqa: SIM117  (one level of HTML a line)
                    with html.Tr(v_for="v in lab_values", key="v.label"):
                        html.Td(v_html=("v.label",))
                        html.Td("{{ v.text }}", style="text-align: right; font-variant-numeric: tabular-nums")
                html.Div(
                    v_html=("lab_readings",),
                    classes="readings text-caption mb-2",
                    raw_attrs=['role="group"', *named("'at the probe'")],
                )
                with html.Div(v_for="p in lab_plots", key="p.title", classes="plot mb-2"):
                    html.Div("{{ p.title }}", classes="text-body-2 font-weight-medium")
                    html.Div(v_html=("p.formula",), classes="formula text-caption")
                    html.Div(v_html=("p.svg",))
                    html.Div(v_html=("p.note",), classes="text-caption")
            with html.Div(v_if="!in_lesson || lab_side === 'model'"):
                with html.Div(v_if="in_lesson"):
                    self._build_outline()
                self._build_panels()
