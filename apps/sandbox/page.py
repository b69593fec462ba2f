"""The page of the sandbox: a trame user interface around the view of an edit window."""

import asyncio
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

from trame.ui.vuetify3 import VAppLayout
from trame.widgets import client, html, vuetify3

from decals.apps.memory import keep_for_work
from decals.apps.sandbox import panels
from decals.apps.sandbox.connections import Connections
from decals.apps.sandbox.folder import IMAGES, MODELS, thumbnails
from decals.apps.sandbox.guard import SCRIPT, Guard
from decals.apps.sandbox.panels import DEFAULTS, TEMPLATES, named, template
from decals.apps.sandbox.sandbox import Sandbox
from decals.apps.sandbox.view import StreamedView
from decals.apps.sandbox.words import words
from decals.editing.actions import KEYS
from decals.editing.formats import EXPORT_SUFFIXES, Video
from decals.window import EditWindow, browser_keys

REFRESH_SECONDS = 0.1
"""Time between two looks at the session, whose changes the page then shows."""

PANEL_WIDTH, LOWER_HEIGHT = 290, 400
"""Width of a panel, and height of one below the view, in pixels."""

NARROW = 900
"""Width of a window, in pixels, below which the panels lie above the view."""

NARROW_WINDOW = f"$vuetify.display.width < {NARROW}"
UPRIGHT_TABLET = (
    f"({NARROW_WINDOW} && $vuetify.display.width > 600 && $vuetify.display.height > $vuetify.display.width)"
)
"""True for a window in which the right panel lies below the view, and both panels beside it."""

ONE_ROW = 1260
"""Width of a window, in pixels, from which on the toolbar is one row."""

PHONE = 600
"""Width of a window, in pixels, below which each part of the toolbar has a row of its own."""

TOOLBAR_HEIGHT = (
    f"$vuetify.display.width < {PHONE} ? 166 + (driving.shared ? 40 : 0) : "
    f"$vuetify.display.width < {ONE_ROW} + (driving.shared ? 320 : 0) ? 96 : 64"
)
"""Height of the toolbar, of which its density takes 16."""

STYLE = Path(__file__).with_name("page.css").read_text(encoding="utf-8")
QUIET = "({ install: () => { console.info = console.log = () => {}; } })"
"""The first plugin of Vue. It turns off trame's notes in the console; warnings and errors stay."""

EVENTS = {*re.findall(r"trigger\(['\"](\w+)", "".join([SCRIPT, *TEMPLATES.values()]))}
EVENTS = EVENTS - {"ask_to_drive", "pass_control", "EVENT"} | {"add", "wrap", "combine"}
"""Events of the `Sandbox` that script and templates send; those of the driver are of `Connections`."""

TOUCH_EVENTS = "touchstart", "touchmove", "touchend", "pointerdown", "pointermove", "pointerup"
"""Events of the view that the script takes first."""

TOOLBAR = {
    "undo": "mdi-undo",
    "redo": "mdi-redo",
    "save": "mdi-content-save-outline",
    "deselect": "mdi-cancel",
    "duplicate": "mdi-content-duplicate",
    "delete": "mdi-delete-outline",
    "help": "mdi-help-circle-outline",
}
"""Icons of the actions in the toolbar."""

FORMATS = {
    "opened": ",".join(MODELS + IMAGES),
    "images": ",".join(IMAGES),
    "exported": " ".join(EXPORT_SUFFIXES),
    "videos": list(map(str, Video)),
}
"""Endings of files, and kinds of videos, that the page offers."""

CTRL_KEYS = "".join(
    gesture[-1]
    for binding in KEYS.bindings
    for gesture in binding.gestures
    if gesture.startswith("Ctrl+") and len(gesture.split("+")[-1]) == 1
)
"""Letters that have an action together with Ctrl."""


def drawer(side: str, width: str = str(PANEL_WIDTH), lower: str = "false") -> Any:
    """Return the panel at a side of the page, with a width that is an expression of the page.

    In a narrow window it is closed at first, above the view; on an upright tablet, both lie beside the view.
    Where the expression `lower` is true, it lies below the view.
    """
    return vuetify3.VNavigationDrawer(
        v_model=(f"{side}_open", None),
        mobile_breakpoint=(f"{UPRIGHT_TABLET} || {lower} ? 0 : {NARROW}",),
        width=(f"{lower} ? {LOWER_HEIGHT} : {width}",),
        location=(f"{lower} ? 'bottom' : '{side}'",),
        order="1" if side == "left" else "0",
        scrim=False,
        raw_attrs=named(f"'{side} panel'"),
    )


class Page:
    """The page of one sandbox.

    Parameters
    ----------
    server
        The trame server.
    window
        The edited window; its plotter is drawn off screen.
    guard
        Checks the requests of the server. Default: one for this machine only, with a new token.
    done
        Show a button that saves and ends the server.
    shared
        One browser is the driver, the others watch.
    options
        Options of the `Sandbox`.

    Attributes
    ----------
    guard
        Its URL opens the page.
    """

    def __init__(
        self,
        server: Any,
        window: EditWindow,
        *,
        guard: Guard | None = None,
        done: bool = False,
        shared: bool = False,
        **options: Any,
    ) -> None:
        self._server, self._window, self._ends = server, window, done
        self.sandbox = Sandbox(window, **options)
        self.guard = guard or Guard()
        self._connections = Connections(
            server,
            guard=self.guard,
            shared=shared,
            end_input=self.sandbox.end_input,
            resized=lambda: self.view.fit(),
        )
        self._task: asyncio.Task[None] | None = None
        self._end: asyncio.Task[None] | None = None
        own = "left_open right_open file_open theme folded sought kind_sought placing word"
        server.state.client_only(*own.split())  # another browser has its own
        server.state.update({**self.values(), "catalog": self.sandbox.catalog(), "thumbnails": thumbnails()})
        server.state.update({"theme": "light", "dropped": None, "dropped_on": "", "folded": [], "sought": ""})
        server.state.update({"kind_sought": "", "placing": "", "word": "", "words": words()})
        server.state.update({"file_open": False, "file_name": "", "file_size": "", "replace_file": False})
        server.state.update({"file_video": str(Video.TURNTABLE), "formats": FORMATS})
        server.state.renamed = {"key": "", "name": ""}
        server.state.menu = {"open": False, "x": 0, "y": 0}
        server.state.change("dropped")(self._take_dropped)
        for name in EVENTS:
            server.controller.trigger(name)(getattr(self.sandbox, name))
        self._build()
        server.controller.on_server_ready.add(self._start)
        server.controller.on_server_exited.add(self._stop)

    def _take_dropped(self, dropped: Any, **_: Any) -> None:
        """Take files that the browser sent."""
        if dropped:
            state = self._server.state
            key, state.dropped, state.dropped_on = state.dropped_on, None, ""
            self.sandbox.upload(dropped, key)

    # -- values -----------------------------------------------------------------------------------------

    def values(self) -> dict[str, Any]:
        """Return all values that the page shows, by their names there."""
        return {**self.sandbox.values(), "coming": ""}

    def refresh(self) -> None:
        """Send the values that have changed; the state leaves out those that are equal."""
        keep_for_work(self._window.background.busy_editing)
        self.sandbox.settle()
        self.view.follow_size()
        values = self.values()
        values["trame__title"] = f"{values['title']} \N{EN DASH} sandbox"  # of the browser's tab
        with self._server.state as state:
            state.update(values)

    def _start(self, **_: Any) -> None:
        self._task = asyncio.get_running_loop().create_task(self._keep_fresh())
        self._window.redraw(whole=True)  # from now on, frames are prepared in slices

    def _stop(self, **_: Any) -> None:
        if self._task is not None:
            self._task.cancel()

    async def _keep_fresh(self) -> None:
        with suppress(asyncio.CancelledError):
            while True:
                self.refresh()
                await asyncio.sleep(REFRESH_SECONDS)

    async def _finish(self) -> None:
        """Save, then end the server."""
        self.sandbox.perform("save")
        while self._window.background.saving:
            await asyncio.sleep(REFRESH_SECONDS)
        # The server waits for this event, so a task of its own stops it.
        self._end = asyncio.create_task(self._server.stop())

    # -- layout -----------------------------------------------------------------------------------------

    def _build(self) -> None:
        self._server.enable_module({"vue_use": [QUIET]})
        with VAppLayout(self._server, vuetify_config={"defaults": DEFAULTS}, full_height=True) as layout:
            layout.root.theme = ("theme",)
            client.Style(STYLE)
            client.Script(SCRIPT)
            with vuetify3.VLayout(full_height=True):
                self._build_toolbar()
                self._build_left_side()
                self._build_right_side()
                with (
                    vuetify3.VMain(),
                    html.Div(
                        style="height: 100%; position: relative; touch-action: none",
                        dragover="$event.preventDefault()",
                        drop="utils.sandbox.take($event, utils.sandbox.place($event))",
                        __events=["dragover", "drop"],
                        raw_attrs=[
                            'role="application"',
                            *named("'view of the scene'"),
                            f'data-ctrl-keys="{CTRL_KEYS}"',
                            """@pointerleave="utils.sandbox.hover('')\"""",
                            *(f'@{name}.capture="utils.sandbox.{name}($event)"' for name in TOUCH_EVENTS),
                        ],
                        **browser_keys(self._window),
                    ),
                ):
                    self.view = StreamedView(
                        self._window,
                        self.sandbox.take_step,
                        lambda: self._connections.behind,
                        lambda: self._connections.sizes,
                        style="height: 100%",
                    )
                    self.sandbox.schedule = self.view.update
                    html.Div(TEMPLATES["view"])
                template("start")
                template("word")
                with vuetify3.VFooter(app=True, order="2", height=28, classes="text-caption"):
                    template("status")

    def _build_left_side(self) -> None:
        """Build what stands left of the view."""
        with drawer("left"):
            self._build_outline()

    def _build_right_side(self) -> None:
        """Build what stands right of the view."""
        with drawer("right", lower=UPRIGHT_TABLET):
            self._build_panels()

    def _build_panels(self) -> None:
        """Build the panels of decals and nodes, and the history."""
        template("scatter", FILL=panels.SUMMARIES["fill"])
        panels.build_options(self.sandbox)
        panels.build_decal_panel(self.sandbox)
        self._build_panel()
        html.Div(TEMPLATES["history"])

    def _build_toolbar(self) -> None:
        with (
            vuetify3.VAppBar(
                density="compact", flat=True, border=True, height=(TOOLBAR_HEIGHT,), classes="toolbar"
            ),
            html.Div(style="display: contents", raw_attrs=['role="toolbar" data-roving', *named("'tools'")]),
        ):
            html.H1("{{ title }}", title=("title",))
            with html.Div(classes="bar"):
                if self._ends:
                    vuetify3.VBtn("Done", color="primary", variant="flat", click=self._finish)
                template("files")
                panels.build_view_menu(self.sandbox)
                for title, icon, family, event in (
                    ("Add", "mdi-plus", "primitives", "add"),
                    ("Modify", "mdi-tune-variant", "modifiers", "wrap"),
                    ("Combine", "mdi-set-center", "combinations", "combine"),
                ):
                    options = {"max_height": 480, "update_modelValue": "utils.sandbox.menu($event)"}
                    with panels.menu(title, icon, width=360, **options), vuetify3.VSheet():
                        template("kinds", FAMILY=family, EVENT=event)
                panels.build_actions(self.sandbox)
            panels.build_brushes(self.sandbox)
            with html.Div(classes="bar first"):
                for side, icon in (("left", "mdi-file-tree-outline"), ("right", "mdi-tune")):
                    panels.icon_button(
                        icon, f"{side} panel", f"{side}_open = !{side}_open", v_if=NARROW_WINDOW
                    )
                for action, icon in TOOLBAR.items():
                    panels.icon_button(
                        icon, panels.SUMMARIES[action], (self.sandbox.perform, f"['{action}']")
                    )
                theme = "theme = theme === 'light' ? 'dark' : 'light'"
                panels.icon_button("mdi-theme-light-dark", "light or dark (Alt + L)", theme)

    def _build_outline(self) -> None:
        template("outline")
        template("file_input", TEXT="add images", KEY="''")
        template("row_changes")

    def _build_panel(self) -> None:
        with html.Div(v_if="panel.kind", classes="pa-3"):
            html.H2("{{ panel.name }}{{ panel.name ? ': ' : '' }}{{ panel.kind }}", classes="text-subtitle-1")
            html.P("{{ panel.doc }}", classes="text-caption mb-3")
            identifiers, key = "'node', c.name", "selected + c.name"
            panels.build_controls("panel.controls", self.sandbox.set_control, identifiers, key=key)
            template("unwrap")
        template("scene")
