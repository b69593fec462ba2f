"""Actions of the editing window by name: all classes of actions, joined.

To add an action, write a method with the decorator `Group.action` in one of these classes. The key table and
the help follow from it.
"""

from os import PathLike

from blobtree.validation import describe
from decals.editing.action_state import ActionState, Cursor
from decals.editing.bare_watch import BareWatch
from decals.editing.brush_actions import BrushActions
from decals.editing.decal_actions import DecalActions
from decals.editing.file_actions import FileActions
from decals.editing.key_bindings import UNREGISTERED, KeyTable, registered_actions
from decals.editing.outline_actions import OutlineActions
from decals.editing.scene_actions import SceneActions
from decals.editing.session import EditSession
from decals.editing.tree_actions import TreeActions
from decals.editing.view_actions import ViewActions
from decals.editing.visibility_actions import VisibilityActions
from decals.editing.zone_actions import ZoneActions
from decals.errors import InvalidEdit


class Actions(SceneActions):
    """Carries out the actions of the key table on an edit session.

    Parameters
    ----------
    session
        The edited session.
    path
        File to save to, if any.
    threaded
        If True, long edits run in threads, and the owner calls ``state.background.poll`` regularly.

    Attributes
    ----------
    state : ActionState
        Selection, message and background jobs.
    bare : BareWatch
        Counts the bare places that edits open.
    decals : DecalActions
        Actions on decals.
    zones : ZoneActions
        Scatters decals in the zone that is selected.
    trees : TreeActions
        Actions on objects and primitives.
    files : FileActions
        Actions on the scene's file.
    visibility : VisibilityActions
        Actions that hide and lock.
    outline : OutlineActions
        Actions on the rows of an outline.
    view : ViewActions
        Actions that move the camera.
    brush : BrushActions
        Actions that choose the brush.
    help_page
        Page of the help that the window shows, from 1; 0 for none.
    help_pages
        Number of pages, which depends on the window's size.
    forget_press
        Forgets what a press of the pointer has begun; returns True if that was a drag.
    deselect_rows
        Deselects the rows of an outline; returns True if some were selected.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import Actions
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=20, images=["eye"])
    >>> actions = Actions(decals.editing.EditSession(scene))
    >>> actions.perform("select_all", lambda: None)
    >>> actions.perform("larger", lambda: None)
    >>> actions.state.message
    'scale'
    """

    def __init__(
        self,
        session: EditSession,
        *,
        path: str | PathLike[str] | None = None,
        threaded: bool = False,
    ) -> None:
        state = ActionState(session, threaded=threaded)
        super().__init__(state, TreeActions(state))
        self.bare = BareWatch(session)
        self.decals, self.zones = DecalActions(state, self.bare.filling), ZoneActions(state)
        self.files = FileActions(state, path)
        self.visibility = VisibilityActions(state)
        self.outline = OutlineActions(state, self.trees, self.visibility)
        self.view, self.brush = ViewActions(state), BrushActions(state)
        owners = self, self.files, self.decals, self.brush, self.trees, self.visibility, self.view
        self._actions = {
            name: (binding, method.__get__(owner))
            for owner, kind in zip(owners, OWNERS, strict=True)
            for name, (binding, method) in registered_actions(kind).items()
        }

    def perform(self, name: str, cursor: Cursor) -> None:
        """Carry out an action; if that is impossible, nothing changes and ``state.message`` says why.

        An action that another edit blocks follows that edit, unless it repeats or the selection changes.

        Parameters
        ----------
        name
            Name of the action in the key table.
        cursor
            Returns the surface point under the cursor, or None.

        Raises
        ------
        InvalidEdit
            There is no such action.
        """
        if not isinstance(name, str) or name not in self._actions:
            raise InvalidEdit(f"action: expected one of the key table, such as 'undo', got {describe(name)}")
        binding, method = self._actions[name]
        self.state.begin_series((name, self.state.selection) if binding.repeats else None, binding.summary)
        self.state.attempt(lambda: method(cursor), waits=not binding.repeats)


OWNERS = SceneActions, FileActions, DecalActions, BrushActions, TreeActions, VisibilityActions, ViewActions
"""Classes of actions, in the order of the help."""

KEYS = KeyTable(
    [
        *(binding for owner in OWNERS for binding, _ in registered_actions(owner).values()),
        *UNREGISTERED,
    ]
)
"""The key table."""
