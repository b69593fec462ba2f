"""``implicit-decals sandbox``: modelling and decals in the browser."""

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from rich.console import Console

from decals.apps.commands.opening import check_options, opened, report_unsaved
from decals.apps.commands.options import Definitions, OptionalWhole, Trust, Whole, check_count
from decals.apps.models.loading import import_definitions
from decals.errors import InvalidInput, MissingPackage
from decals.window import EditWindow
from decals.window.host_plotter import new_plotter

HOST = "127.0.0.1"
"""The page is served to this machine only."""

MAX_PORT = 65535
FIRST_SIZE = (700, 700)
"""Width and height of the view in pixels until the page tells its own."""


def sandbox(
    model: Annotated[list[str] | None, Parameter(negative=(), show_default=False)] = None,
    /,
    *,
    decals: OptionalWhole = None,
    image: Annotated[
        list[str] | None, Parameter(name=("--image", "--images"), negative=(), show_default=False)
    ] = None,
    up: Annotated[Literal["x", "y", "z"] | None, Parameter(show_default=False)] = None,
    seed: OptionalWhole = None,
    save: Path | None = None,
    define: Definitions = None,
    port: Whole = 8080,
    browser: bool = True,
    trust: Trust = False,
    lab: Annotated[bool, Parameter(negative=())] = False,
    lessons: Path | None = None,
) -> None:
    """Open models or a scene in the sandbox, a page in the browser.

    The page is served to this machine only. Ctrl + C in the terminal ends it; unsaved changes are kept.

    Parameters
    ----------
    model
        Mesh files, BlobTrees in JSON, samples, or one saved scene, as for render. Default: a start page.
    decals
        Number of decals scattered at the start. Default: 500.
    image
        Image of the decals, as for render. Can be repeated. A saved scene keeps its images, and these are
        added. Default: scale.
    up
        The axis that points upward. Default: y, or the axis of the sample.
    seed
        Seed of the random numbers: equal seeds give equal decals. Default: 0.
    save
        The JSON file that Ctrl + S writes. Default: the opened scene, or a new file such as MODEL-decals.json
        or scene.json.
    define
        A Python file or module that defines the custom nodes of BlobTrees in JSON. Its code is run. Can be
        repeated.
    port
        Port of the page; 0 takes a free one.
    browser
        Open the page in the default browser.
    trust
        Let a scene read files outside its folder, and any number of images.
    lab
        Open the contact lab: six lessons on decals and solids in contact.
    lessons
        A folder of other lessons for the lab.
    """
    check_options(decals, seed, save)
    check_count("--port", port, 0, MAX_PORT)
    serve, page = _toolkit()
    if lab or lessons is not None:
        page = _lab(model, lessons)
    import_definitions(define)
    opening = opened(
        model, decals=decals, image=image, up=up, pixels=FIRST_SIZE, seed=seed, save=save, trust=trust
    )
    plotter = new_plotter(True, FIRST_SIZE)
    window = EditWindow(opening.scene, path=opening.path, plotter=plotter, recover=opening.recover)
    opening.add_images(window)
    try:
        with window:
            window.show()
            server = serve(f"sandbox {id(window)}", client_type="vue3")
            page(server, window, start=not model)
            server.controller.on_server_ready.add(lambda **_: _announce(server.port))
            server.start(host=HOST, port=port, open_browser=browser, show_connection_info=False, timeout=0)
    finally:
        report_unsaved(window, "sandbox")


def _toolkit() -> tuple[Any, Any]:
    """Return trame's server and our page, which needs trame."""
    try:
        from trame.app import get_server

        from decals.apps.sandbox.page import Page
    except ImportError as error:
        raise MissingPackage(
            f"the sandbox needs trame ({error}); install it with: pip install 'implicit-decals[browser]'"
        ) from None
    return get_server, Page


def _lab(model: list[str] | None, folder: Path | None) -> Any:
    """Return the page of the contact lab, which brings its own scenes."""
    from decals.apps.lab.lesson import LESSONS, load_lessons
    from decals.apps.lab.page import LabPage

    if model:
        raise InvalidInput("the lab has its own scenes; leave out the model, or --lab and --lessons")
    found = load_lessons(LESSONS if folder is None else folder)
    return lambda server, window, **_: LabPage(server, window, found)


def _announce(port: int) -> None:
    Console(stderr=True, soft_wrap=True).print(
        f"sandbox at http://{HOST}:{port}/ (Ctrl + C ends it)", highlight=False, markup=False
    )
