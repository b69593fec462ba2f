"""`page` and `save_html`: a scene as one HTML page, where any browser shows and moves its decals."""

import base64
import html
import inspect
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from blobtree.colors import ColorLike
from blobtree.errors import InvalidResolution
from blobtree.files import write_atomically
from blobtree.immutable import Immutable
from blobtree.progress import Progress, reporting
from blobtree.tracing.tree_cells import BLOCKS_ALONG
from blobtree.validation import describe, truth
from decals.errors import InvalidScene, NoGraphics
from decals.field.mapping import ImageMapping
from decals.hosts.unsupported import refuse_unsupported
from decals.pages.contents import page_contents
from decals.pages.packing import packed
from decals.record import Contact
from decals.rendering.options import Background, as_background
from decals.rendering.picture import on_white
from decals.scenes.cover import as_scene
from decals.scenes.objects import SceneObject
from decals.scenes.pose import PosedScene
from decals.scenes.scene import Scene
from decals.surfaces.convert import Model
from decals.validation import MAX_STIFFNESS, checked_path, is_unicode, one_of, whole_number

MODULES = (
    *("vectors", "packing", "texels", "index", "decals", "history", "camera", "link", "graphics", "painter"),
    *("files", "controls", "pointer", "viewer"),
)
"""Modules of the viewer, each after those that it imports."""

PICTURE_SIZE = 480, 360
"""Width and height of the picture that is shown without WebGL 2, in pixels."""

PICTURE_QUALITY = 85
"""Quality of that picture, of 100."""

NOTEBOOK_HEIGHT = 520
"""Height of a page in a notebook, in pixels."""

SURFACES = "mesh", "traced"
"""Ways to show trees."""

SUFFIXES = ".html", ".htm"
"""Ends of the names of pages."""

LINKS = re.compile(r"^(import [^;]*;\n|export )", re.MULTILINE)
"""What joins modules, and what one script of all of them does without."""

SLOT = re.compile(r"<!--([A-Z]+)-->")
"""Places of the page's template that are filled."""

TOOLTIP = re.compile(r' title="([^"]*)"')
"""Titles of buttons, which are also their labels for people who do not see them."""

VIEWER = Path(__file__).parent / "viewer"
"""Template, style and modules of the viewer."""


@dataclass(frozen=True, eq=False)
class Page(Immutable):
    """A scene as one HTML page, see `page`. A notebook shows it inline.

    Attributes
    ----------
    text : str
        The whole page.
    data : str
        The part of it that the module of `viewer_script` shows.
    title : str
        Its title.
    """

    text: str = field(repr=False)
    data: str = field(repr=False)
    title: str

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page to a file named ``.html``, whole or not at all.

        Raises
        ------
        InvalidScene
            The file has another name, or its folder does not exist or cannot be written.
        UnusableFile
            The file cannot be written.

        Examples
        --------
        >>> import blobtree, decals
        >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
        >>> decals.pages.page(scene, resolution=16).save("ball.html")
        """
        write_atomically(checked_path(path, SUFFIXES), self.text.encode("utf-8"))

    def _repr_html_(self) -> str:
        title, text = html.escape(self.title), html.escape(self.text)
        style = f"width: 100%; height: {NOTEBOOK_HEIGHT}px; border: 0"
        allowed = "allow-scripts allow-downloads"  # not what the notebook itself may do
        return f'<iframe title="{title}" style="{style}" sandbox="{allowed}" srcdoc="{text}"></iframe>'


def page(
    scene: Scene | PosedScene | SceneObject | Model | Sequence[SceneObject | Model],
    *,
    title: str | None = None,
    alt: str | None = None,
    controls: bool = True,
    background: Background | ColorLike | None = None,
    surface: str = "mesh",
    resolution: int | None = None,
    contact: Contact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    progress: Progress | None = None,
) -> Page:
    """Return a scene as one HTML page that shows it in any browser, without a server and without a network.

    Decals can be picked, dragged, turned, scaled, added and deleted there; neighbours make room at once. A
    link keeps the state, and the scene can be saved as a file for `decals.load_scene`. The page needs WebGL 2
    and shows a picture without it.

    Parameters
    ----------
    scene : Scene, PosedScene, SceneObject or Model
        A scene, also one with rigid poses; or a model as `decals.cover` takes it, a list of such models, or
        the path of a model or a scene.
    title : str, optional
        Title of the page. Default: names of the objects.
    alt : str, optional
        What the picture shows, for people who do not see it. Default: the objects and the number of decals.
    controls : bool
        False leaves out the buttons. Mouse, touch and keys stay.
    background : Background or colour, optional
        In place of that of the scene.
    surface : str
        How trees are shown: as ``"mesh"``, which any device draws fast, or ``"traced"`` as `decals.render`
        does, which is exact.
    resolution : int, optional
        Cells along the longest side of trees that are meshes, as for `blobtree.polygonize`.
    contact, stiffness, mapping : optional
        Modes, as for `decals.render`. Default: those of the scene.
    progress : callable, optional
        Function of the stage and its finished fraction, 0 to 1, called repeatedly.

    Returns
    -------
    Page
        The text of the page.

    Raises
    ------
    InvalidScene
        No scene, one without objects, or one with a feature that pages do not have, see `decals.shader`.
    TooMuchData
        More decals than a page shows.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
    >>> shown = decals.pages.page(scene, title="Ball", resolution=16)
    >>> shown
    Page(title='Ball')
    >>> "http://" in shown.text or "https://" in shown.text
    False
    """
    given = as_scene(_unposed(scene))
    drawing = given.drawing.overridden(contact=contact, stiffness=stiffness, mapping=mapping)
    given = given.replace(drawing=drawing)
    names = ", ".join(item.name for item in given.objects)
    title = _text("title", title, names or "Decals")
    alt = _text("alt", alt, f"{names} with {len(given.decals)} decals")
    truth("controls", controls, InvalidScene)
    if resolution is not None:
        whole_number("resolution", resolution, 1, None, InvalidResolution)
    one_of("surface", surface, SURFACES, InvalidScene)
    sky = drawing.background if background is None else as_background(background)
    with reporting(progress) as report:
        slots = viewer_slots(
            given,
            title,
            alt,
            controls=controls,
            background=sky,
            traced=BLOCKS_ALONG if surface == "traced" else 0,
            resolution=resolution,
            report=report,
        )
    script = as_script(viewer_script(name="mountOver"), "mountOver") + _read("start.js")
    return Page(filled(_read("page.html"), {**slots, "SCRIPT": script}), slots["DATA"], title)


def viewer_slots(
    scene: Scene,
    title: str,
    alt: str,
    *,
    controls: bool,
    background: Background,
    traced: int,
    resolution: int | None,
    report: Progress,
    picture: Scene | None = None,
) -> dict[str, str]:
    """Return what a template of a page shows of a scene: its slots but for the script.

    The picture without WebGL 2 is that of the scene, or of another one.
    """
    header, arrays = page_contents(scene, traced=traced, resolution=resolution, report=report)
    texts = {"TITLE": html.escape(title), "ALT": html.escape(alt)}
    modes = "".join(f"<option>{mode}</option>" for mode in header["shaders"]["modes"])
    tools = {
        "MODES": modes,
        "BACKGROUND": _gradient(background),
        "DOUBLINGS": f"{math.log2(MAX_STIFFNESS):g}",
    }
    markup = TOOLTIP.sub(r'\g<0> aria-label="\1"', filled(_read("controls.html"), {**texts, **tools}))
    data = packed({**header, "markup": markup, "controls": controls}, arrays)
    return {**texts, "PICTURE": _picture(picture or scene), "STYLE": _read("page.css"), "DATA": data}


def _unposed(scene: Any) -> Any:
    """Return a scene with rigid poses as a plain one; raise `InvalidScene` for other poses."""
    if not getattr(scene, "posed", False):
        return scene
    refuse_unsupported(scene, scene.drawing)
    fields = ("objects", "camera", "decals", "images", "drawing")
    return Scene(**{name: getattr(scene, name) for name in fields})


def save_html(
    scene: Scene | PosedScene | SceneObject | Model | Sequence[SceneObject | Model],
    path: str | os.PathLike[str],
    **options: Any,
) -> None:
    """Write a scene as one HTML file; options and errors are those of `decals.pages.page`.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20, images=["scale"])
    >>> decals.save_html(scene, "ball.html", resolution=16)
    """
    path = checked_path(path, SUFFIXES)  # before the long work
    known = inspect.signature(page).parameters
    for name in options:
        if name not in known:
            raise TypeError(f"save_html() got an unexpected keyword argument {name!r}")
    page(scene, **options).save(path)


@cache
def viewer_script(*more: str, name: str = "mount") -> str:
    """Return the viewer, with the texts of more modules, as one ES module that exports a function."""
    texts = "".join([*(_read(f"{module}.mjs") for module in MODULES), *more])
    return f"{LINKS.sub('', texts)}export {{ {name} }};\n"


def as_script(module: str, name: str) -> str:
    """Return a module that exports a function as a classic script: browsers load no modules from files."""
    body = module.replace(f"export {{ {name} }};", f"return {{ {name} }};")
    return f"const {{ {name} }} = (() => {{\n{body}}})();\n"


def _read(name: str) -> str:
    """Return a file of the viewer."""
    return (VIEWER / name).read_text(encoding="utf-8")


def filled(template: str, slots: Mapping[str, str]) -> str:
    """Return the text of a template with its slots filled."""
    parts = SLOT.split(template)
    parts[1::2] = [slots[slot] for slot in parts[1::2]]
    return "".join(parts)


def _gradient(background: Background) -> str:
    """Return a background as a value of CSS."""
    colors = []
    for *rgb, alpha in (background.top, background.bottom):
        colors.append(f"rgb({' '.join(f'{100 * level:.4g}%' for level in rgb)} / {alpha:.4g})")
    return f"linear-gradient({', '.join(colors)})"


def _text(name: str, value: Any, default: str) -> str:
    if value is not None and not (isinstance(value, str) and is_unicode(value)):
        raise InvalidScene(f"{name}: expected a text of Unicode characters, got {describe(value)}")
    return value or default


def _picture(scene: Scene) -> str:
    """Return a picture of the scene as a data URL; empty where nothing can be drawn."""
    try:
        pixels = scene.render(size=PICTURE_SIZE).pixels
    except NoGraphics:
        return ""
    content = BytesIO()
    on_white(Image.fromarray(pixels)).save(content, "jpeg", quality=PICTURE_QUALITY)
    return f"data:image/jpeg;base64,{base64.b64encode(content.getvalue()).decode('ascii')}"
