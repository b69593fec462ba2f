"""`edit`: edit a scene in a window, or in a notebook."""

import os
from collections.abc import Sequence
from pathlib import Path

from blobtree.progress import in_notebook
from decals.editing.session import EditSession
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
from decals.scenes.cover import as_scene
from decals.scenes.files import load_scene
from decals.scenes.objects import SceneObject
from decals.scenes.scene import Scene
from decals.surfaces.convert import Model
from decals.window.host_plotter import DEFAULT_SIZE
from decals.window.notebook import edit_in_notebook
from decals.window.window import EditWindow


def edit(
    scene: Scene | EditSession | SceneObject | Model | Sequence[SceneObject | Model],
    *,
    path: str | os.PathLike[str] | None = None,
    size: tuple[int, int] = DEFAULT_SIZE,
    contact: AnyContact | str | None = None,
    mapping: ImageMapping | str | None = None,
    stiffness: float | None = None,
) -> Scene:
    """Open a window to edit a scene, and return the edited scene when the window is closed.

    In a notebook, the page of the sandbox appears below the cell instead, until its Done is pressed. There,
    modes are chosen in the page.

    Parameters
    ----------
    scene : Scene, EditSession, SceneObject or Model
        A scene or a session; or a model as `decals.cover` takes it, a list of such models, or the path of a
        model or a scene.
    path : str or path-like, optional
        File to save to with Ctrl + S. Unsaved changes that an earlier window left in its recovery file are
        opened, as one undo entry.
    size : (int, int)
        Width and height of the window in pixels.
    contact : Contact or str, optional
        Contact mode at the beginning. Default: that of the scene's ``drawing``, which the editor changes.
    mapping : ImageMapping or str, optional
        Image mapping at the beginning, likewise.
    stiffness : float, optional
        Stiffness of elastic contact at the beginning, likewise.

    Returns
    -------
    Scene
        The edited scene.

    Raises
    ------
    NoGraphics
        There is no OpenGL, or no screen for a window.
    InvalidScene
        The scene, path or size is not valid.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=30, images=["eye"])
    >>> edited = decals.edit(scene)  # doctest: +SKIP
    """
    edited = scene if isinstance(scene, EditSession) else as_scene(scene)
    if isinstance(edited, Scene) and in_notebook():
        return edit_in_notebook(edited, None if path is None else Path(path))
    with EditWindow(
        edited,
        path=path,
        size=size,
        recover=load_scene,
        contact=contact,
        mapping=mapping,
        stiffness=stiffness,
    ) as window:
        window.show()
        return window.document.scene
