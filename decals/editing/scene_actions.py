"""Actions on the selection and the whole scene: undo, redo, how it is drawn, and the help."""

from collections.abc import Callable

from blobtree.nodes.paths import Path
from decals.editing.action_state import ActionState, Cursor, joined
from decals.editing.brush_settings import Brush
from decals.editing.commands import DeleteDecals, DuplicateDecals, are_many
from decals.editing.key_bindings import Group
from decals.editing.session import EditSession, UndoEntry
from decals.editing.tree_actions import TreeActions
from decals.errors import InvalidEdit
from decals.field.mapping import ImageMapping
from decals.record import Contact
from decals.validation import whole_number

STIFFNESSES = 1.0, 1.5, 2.0, 3.0, 6.0
"""Stiffnesses that a key goes through."""


class SceneActions:
    """Actions on the selection and the whole scene.

    Parameters
    ----------
    state
        State of the window.
    trees
        Actions on the selected primitive.
    """

    def __init__(self, state: ActionState, trees: TreeActions) -> None:
        self.state, self.trees = state, trees
        self.help_page, self.help_pages = 0, 1
        self.forget_press: Callable[[], bool] = lambda: False
        self.deselect_rows: Callable[[], bool] = lambda: False

    # -- selection --------------------------------------------------------------------------------------

    @Group.SELECTION.action(
        "select", "Click", summary="select the decal under the cursor, else the primitive"
    )
    def select(self, cursor: Cursor, *, further: bool = False) -> None:
        """Select the decal under the cursor, else the primitive, else nothing.

        With `further`, select what follows the selection: the primitive after a decal, then the node above.
        """
        state, pick = self.state, cursor()
        state.picked, state.message = pick, ""
        choices: list[tuple[tuple[int, ...], tuple[int, Path] | None]] = []
        if pick is not None:
            choices += [(owner, None)] if (owner := state.selectable([pick.owner])) else []
            choices += [((), node) for node in self.trees.nodes_at(pick)]
        present = state.selection, state.primitive
        turn = choices.index(present) + 1 if further and present in choices else 0
        self._deselect_all()
        if pick is None or not choices:
            return
        state.selection, node = choices[turn % len(choices)]
        if node is None:
            state.message = f"decal {pick.owner}"
        else:
            self.trees.select_picked(*node, pick)

    @Group.SELECTION.action(
        "select_further",
        "Click again",
        summary="select the primitive there, then the node above it",
    )
    def select_further(self, cursor: Cursor) -> None:
        """Select the primitive below a selected decal, or the node above a selected one."""
        self.select(cursor, further=True)

    @Group.SELECTION.action(
        "select_also", "Shift+Click", summary="add the decal to the selection, or the primitive to others"
    )
    def select_also(self, cursor: Cursor, *, toggle: bool = False) -> None:
        """Add the decal under the cursor to the selection; with `toggle`, remove it if it is selected.

        Beside selected nodes, or where no decal is and none is selected, the primitive is added or removed.
        """
        state, pick = self.state, cursor()
        if pick is None:
            return
        owner = () if state.primitive_is_subject else state.selectable([pick.owner])
        if owner:
            state.selection, state.primitive = joined(state.selection, owner[0], toggle=toggle), None
            state.message = f"{len(state.selection)} decals"
        elif not state.selection and (nodes := self.trees.nodes_at(pick)):
            self.trees.select_also(*nodes[0], toggle=toggle)

    @Group.SELECTION.action("toggle", "Ctrl+Click", summary="add them likewise, or remove them")
    def toggle(self, cursor: Cursor) -> None:
        """Add the decal or the primitive under the cursor to the selection, or remove it."""
        self.select_also(cursor, toggle=True)

    @Group.SELECTION.action("select_all", "Ctrl+a", summary="select all decals")
    def select_all(self, _cursor: Cursor) -> None:
        """Select all decals."""
        self.state.selection = self.state.selectable(self.state.session.document.decals.numbers)
        self.state.message = f"{len(self.state.selection)} decals"

    @Group.SELECTION.action(
        "deselect", "Escape", summary="end the first of: help, brush, drag, selection, edit, export"
    )
    def deselect(self, _cursor: Cursor) -> None:
        """End the help, else the brush, else the drag, else the selection, else the edit, else all exports.

        A brush ends with its stroke, which is reverted.
        """
        state = self.state
        state.message = ""
        if self.help_visible:
            self.help_page = 0
        elif state.brush.brush is not Brush.SELECT:
            state.brush.brush = Brush.SELECT
            self._revert_drag()
        elif not self._revert_drag() and not self._deselect_all():
            state.background.cancel(exports=True)

    def _revert_drag(self) -> bool:
        """Revert the drag; return False without a drag."""
        background = self.state.background
        dragged = self.forget_press() or self.state.session.stroke_open or background.following
        if dragged:
            background.revert_drag()
        return dragged

    def _deselect_all(self) -> bool:
        """Deselect decals, primitive and rows; return False if nothing was selected."""
        state = self.state
        selected = self.deselect_rows() or bool(state.selection) or state.primitive is not None
        state.selection, state.primitive = (), None
        return selected

    @Group.SELECTION.action(
        "duplicate", "d", summary="duplicate the selected decals, else the selected primitive"
    )
    def duplicate(self, _cursor: Cursor) -> None:
        """Duplicate the selected decals and select the copies, or duplicate the selected primitive."""
        state = self.state
        if state.primitive_is_subject:
            self.trees.duplicate_selected()
            return
        count = len(state.selection)

        def select() -> None:
            end = state.session.document.decals.next_number
            state.selection = tuple(range(end - count, end))

        state.run(DuplicateDecals(state.selected_numbers), select)

    @Group.SELECTION.action(
        "delete", "Delete", "BackSpace", summary="delete the selected decals, else the selected nodes"
    )
    def delete(self, _cursor: Cursor) -> None:
        """Delete the selected decals, or the selected nodes."""
        if not self.state.primitive_is_subject:
            self.state.run(DeleteDecals(self.state.selected_numbers))
        elif len(self.state.nodes) > 1:
            self.trees.delete_nodes(self.state.nodes)
        else:
            self.trees.delete_selected()

    # -- scene ------------------------------------------------------------------------------------------

    @Group.SCENE.action("undo", "Ctrl+z", summary="undo")
    def undo(self, _cursor: Cursor) -> None:
        """Undo the last entry."""
        self._step_through_history(lambda: self.state.session.next_undo, "undo", _undo)

    @Group.SCENE.action("redo", "Ctrl+y", "Ctrl+Shift+z", summary="redo")
    def redo(self, _cursor: Cursor) -> None:
        """Redo the entry that was undone last."""
        self._step_through_history(lambda: self.state.session.next_redo, "redo", _redo)

    def _step_through_history(
        self,
        next_entry: Callable[[], UndoEntry | None],
        name: str,
        step: Callable[[EditSession, UndoEntry], str],
    ) -> None:
        """Undo or redo an entry after the steps of a drag, in the background if it changes many decals."""
        state = self.state

        def step_once() -> None:
            entry = next_entry()
            if entry is not None and entry.edit.parts_after.objects is not None:
                state.background.require_idle(name)  # the running edit is computed for the present objects
            if entry is None:
                state.message = f"nothing to {name}"
            elif are_many(entry.edit.after.numbers):
                state.background.edit(name, lambda session: step(session, entry))
            else:
                state.message = step(state.session, entry)

        self.when_idle(name, step_once)

    def when_idle(self, label: str, step: Callable[[], None]) -> None:
        """End a drag, and take a step once its edits are adopted; `Busy` while another edit runs."""
        background = self.state.background

        def followed() -> None:
            background.require_idle(label, computing=False)
            step()

        if self.state.session.stroke_open:
            self.trees.end_drag()
        background.when_followed(followed)

    def go_to(self, count: int) -> None:
        """End a drag, then undo or redo until so many entries of the history are done.

        Raises
        ------
        InvalidEdit
            The history has fewer entries, or another edit runs.
        """
        session = self.state.session
        total = len(session.labels) + len(session.undone_labels)
        number = whole_number("history", count, 0, total, InvalidEdit)

        def step() -> None:
            while len(session.labels) > number:
                session.undo()
            while len(session.labels) < number and session.redo() is not None:
                pass
            self.state.show(f"history: after {session.labels[-1]}" if number else "history: at the start")

        self.when_idle("go through the history", step)

    @Group.SCENE.action("next_contact", "p", summary="contact mode: product, min, radial, elastic")
    def next_contact(self, _cursor: Cursor) -> None:
        """Draw with the next contact mode."""
        contact = Contact((int(self.state.session.document.drawing.contact) + 1) % len(Contact))
        self.state.draw_with(f"contact mode: {contact.name.lower()}", contact=contact)

    @Group.SCENE.action("next_stiffness", "Shift+p", summary="stiffness of elastic contact: 1, 1.5, 2, 3, 6")
    def next_stiffness(self, _cursor: Cursor) -> None:
        """Draw with the next stiffness."""
        present = self.state.session.document.drawing.stiffness
        stiffness = next((one for one in STIFFNESSES if one > present), STIFFNESSES[0])
        self.state.draw_with(f"stiffness of elastic contact: {stiffness:g}", stiffness=stiffness)

    @Group.SCENE.action("next_mapping", "u", summary="image mapping of the window: corrected, chord, walked")
    def next_mapping(self, _cursor: Cursor) -> None:
        """Draw with the next image mapping."""
        mapping = ImageMapping((self.state.session.document.drawing.mapping - 1) % len(ImageMapping))
        self.state.draw_with(f"image mapping: {mapping.name.lower()}", mapping=mapping)

    @Group.SCENE.action("help", "h", "F1", summary="show this help, its next page, or hide it")
    def turn_help(self, _cursor: Cursor) -> None:
        """Show the help or its next page; after the last page hide it."""
        self.help_page = (self.help_page + 1) % (self.help_pages + 1)

    @property
    def help_visible(self) -> bool:
        """True while the window shows the help."""
        return self.help_page > 0


def _undo(session: EditSession, entry: UndoEntry) -> str:
    if session.next_undo is not entry:
        raise InvalidEdit("another edit was made meanwhile; undo again")
    return f"undid: {session.undo()}"


def _redo(session: EditSession, entry: UndoEntry) -> str:
    if session.next_redo is not entry:
        raise InvalidEdit("another edit was made meanwhile; there is nothing to redo")
    return f"redid: {session.redo()}"
