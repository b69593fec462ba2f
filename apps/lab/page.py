"""The page of the contact lab: the sandbox with a lesson on the left and its plots on the right."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from trame.widgets import client, html, vuetify3

from decals.apps.lab.lab import Lab
from decals.apps.lab.lesson import Lesson
from decals.apps.lab.symbols import styles
from decals.apps.sandbox.page import PANEL_WIDTH, PHONE, UPRIGHT_TABLET, Page, drawer
from decals.apps.sandbox.panels import build_controls, icon_button, named
from decals.editing.slicing import NONE
from decals.errors import InvalidEdit
from decals.window import EditWindow

LESSON_WIDTH, PLOTS_WIDTH = 370, 350

ON_PHONE = f"$vuetify.display.width <= {PHONE}"
"""True for a window in which a lesson lies below the view."""

CHOOSE = "coming = lab_titles[$event].title; trigger('start_lesson', [$event])"
"""Starts a chosen lesson, whose title stands above the view until its picture is there."""

STYLE, LESSON, PLOTS = (
    Path(__file__).with_name(name).read_text(encoding="utf-8")
    for name in ("page.css", "lesson.html", "plots.html")
)
STYLE += styles(".v-application")


class LabPage(Page):
    """A page of the sandbox with lessons.

    Parameters
    ----------
    server, window
        As for `Page`.
    lessons
        The lessons.
    begin
        Index of the lesson to begin with. None begins without a lesson.
    options
        Options of the `Sandbox`.
    """

    def __init__(
        self,
        server: Any,
        window: EditWindow,
        lessons: Sequence[Lesson],
        *,
        begin: int | None = 0,
        **options: Any,
    ) -> None:
        self.lab = Lab(window, lessons)
        server.state.update({"lab_side": "plots", "lab_script": "", "lab_shared": "", **self.lab.values()})
        titles = [lesson.settings.title for lesson in lessons]
        super().__init__(server, window, lessons=titles, start_lesson=self.lab.start, **options)
        trigger = server.controller.trigger
        trigger("check")(self.lab.check)
        trigger("start_lesson")(self._restart)
        trigger("puzzle")(lambda text: self.sandbox.attempt(lambda: self._play(text)))
        trigger("guess")(lambda value: self.sandbox.attempt(lambda: self._guess(value)))
        if begin is not None:
            self.sandbox.open_lesson(begin)
        server.controller.on_server_exited.add(lambda **_: self.lab.close())

    def values(self) -> dict[str, Any]:
        """Return all values that the page shows, by their names there."""
        in_lesson = self.sandbox.in_lesson
        points = {"probe": (self.lab.probe, self.lab.move_probe)} if in_lesson else {}
        self.sandbox.display.points = points
        values = {**super().values(), "in_lesson": in_lesson}
        if in_lesson:
            self.lab.cut(self.sandbox.display.options.slice)
            self.lab.refresh()
            values |= {**self.lab.values(), "title": self.lab.lesson.settings.title, "left_open": True}
            coming = values["lab_titles"][values["lab_number"]]["title"]
            values["coming"] = "" if self.view.shows(self.lab.begun) else coming
        elif self._server.state.in_lesson:
            self.lab.leave()
        return values

    def _build_left_side(self) -> None:
        with drawer("left", f"(in_lesson ? {LESSON_WIDTH} : {PANEL_WIDTH})", f"(in_lesson && {ON_PHONE})"):
            client.Style(STYLE)
            client.ClientTriggers(mounted="utils.sandbox.puzzles((text) => trigger('puzzle', [text]))")
            with html.Div(v_if="!in_lesson"):
                self._build_outline()
            with html.Div(v_if="in_lesson", classes="pa-3 lesson-side"):
                with html.Div(classes="d-flex align-center ga-1 mb-2"):
                    vuetify3.VSelect(
                        model_value=("lab_number",),
                        items=("lab_titles",),
                        raw_attrs=named("'lesson'"),
                        update_modelValue=CHOOSE,
                    )
                    icon_button("mdi-restart", "start the lesson again", (self._restart, "[lab_number]"))
                    icon_button("mdi-language-python", "lines of Python for this picture", self._show_script)
                    keep = self.sandbox.close_lesson, "[true]"
                    icon_button("mdi-open-in-app", "open in the sandbox", keep)
                    icon_button("mdi-close", "leave the lesson", self.sandbox.close_lesson)
                html.Div(LESSON)
                with html.Div(v_if="!lab_guess.waits", classes="lesson-sliders"):
                    build_controls("lab_sliders", self._set_value, "c.number", key="lab_number + c.name")

    def _show_script(self) -> None:
        """Show the lines of Python that make the present picture."""
        self.sandbox.attempt(lambda: self._server.state.update({"lab_script": self.lab.script()}))

    def _guess(self, value: Any) -> None:
        """Take a guess, if a lesson asks for one."""
        if not (self.sandbox.in_lesson and self.lab.lesson.settings.guess):
            raise InvalidEdit("no lesson asks for a guess now; start one that does")
        self.lab.guess(value)

    def _play(self, text: Any) -> None:
        """Start the puzzle of a link."""
        number, puzzle = self.lab.puzzle(text)
        if not self.sandbox.in_lesson:
            self.sandbox.open_lesson(number)
        self.lab.start(number, puzzle=puzzle)

    def _restart(self, number: int) -> None:
        """Start a lesson from its beginning, without a slice."""
        self.sandbox.display.set_option("slice", NONE)
        self.sandbox.attempt(lambda: self.lab.start(number))

    def _set_value(self, number: int, raw: Any, last: bool = True) -> None:
        """Set what a slider of the lesson moves."""
        self.sandbox.slide(lambda: self.lab.set_value(number, raw, last), last=bool(last))

    def _build_right_side(self) -> None:
        with drawer("right", f"(in_lesson ? {PLOTS_WIDTH} : {PANEL_WIDTH})", UPRIGHT_TABLET):
            html.Div(PLOTS, v_if="in_lesson")
            with html.Div(v_if="!in_lesson || lab_side === 'model'"):
                with html.Div(v_if="in_lesson"):
                    self._build_outline()
                self._build_panels()
