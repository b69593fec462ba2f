"""Actions that hide, show, isolate and lock nodes, objects, decals and layers."""

from collections.abc import Sequence

import numpy as np

from blobtree.nodes.paths import Path
from blobtree.validation import describe
from decals.editing.action_state import Cursor, WindowActions, require_pick
from decals.editing.key_bindings import Group
from decals.editing.visibility import (
    FlagNodes,
    HideDecals,
    LockLayers,
    ShowDecals,
    isolating,
)
from decals.errors import InvalidEdit


class VisibilityActions(WindowActions):
    """Actions on the selected decals or node, else on the object under the cursor."""

    def _subject(self, cursor: Cursor) -> tuple[int, Path]:
        """Return object and path of the selected node, else those of the object under the cursor."""
        return self._state.primitive or (require_pick(cursor).object, ())

    @Group.SCENE.action("hide", "v", summary="hide the selection, else the object")
    def hide(self, cursor: Cursor) -> None:
        """Hide the selected decals or node, or the object under the cursor."""
        if self._state.selection:
            self._state.run(HideDecals(self._state.selection))
        else:
            self.flag_node("hidden", *self._subject(cursor))

    @Group.SCENE.action("show_all", "Shift+v", summary="show everything that is hidden")
    def show_all(self, _cursor: Cursor) -> None:
        """Show all objects, nodes and decals."""
        session = self._state.session
        flags: dict[int, tuple[Path, ...]] = dict.fromkeys(range(len(session.document.objects)), ())
        with session.stroke("show all"):
            session.do(FlagNodes(flags))
            session.do(ShowDecals())
        self._state.message = "everything is shown"

    @Group.SCENE.action("isolate", "Shift+f", summary="hide everything else")
    def isolate(self, cursor: Cursor) -> None:
        """Hide all decals but the selected ones; else all but the node, or the object under the cursor."""
        if self._state.selection:
            numbers = self._state.session.document.decals.numbers
            self._state.run(HideDecals(np.setdiff1d(numbers, self._state.selection)))
        else:
            self.isolate_node(*self._subject(cursor))

    @Group.SCENE.action("lock", "Shift+l", summary="lock the selection, else the object; or unlock it")
    def lock(self, cursor: Cursor) -> None:
        """Lock the layers of the selected decals, the selected node, or the object under the cursor."""
        if self._state.selection:
            decals = self._state.session.document.decals.take(self._state.selected_numbers)
            for layer in np.unique(decals.layers).tolist():
                self.flag_layer("locked", layer)
        else:
            self.flag_node("locked", *self._subject(cursor))

    # -- outline ----------------------------------------------------------------------------------------

    def isolate_node(self, number: int, path: Path) -> None:
        """Hide everything but a node; if that is so already, show all objects and nodes."""
        document = self._state.session.document
        command = isolating(document, number, path)
        shown: dict[int, tuple[Path, ...]] = dict.fromkeys(range(len(document.objects)), ())
        flags = shown | command.hidden
        done = all(set(item.hidden) == set(flags[n]) for n, item in enumerate(document.objects))
        self._state.run(FlagNodes(shown, label="show all") if done else command)

    def flag_node(self, flag: str, number: int, path: Path, others: Sequence[tuple[int, Path]] = ()) -> None:
        """Hide or lock a node, or show or unlock it: ``flag`` is "hidden" or "locked"; others likewise."""
        object_at = self._state.session.document.object
        off = path in getattr(object_at(number), flag)
        places = {(number, path), *others}
        flags = {each: {*getattr(object_at(each), flag)} for each, _ in places}
        for each, node in places:
            (flags[each].discard if off else flags[each].add)(node)
        verb = {"hidden": ("hide", "show"), "locked": ("lock", "unlock")}[flag][off]
        paths = {each: tuple(sorted(nodes)) for each, nodes in flags.items()}
        self._state.run(FlagNodes(**{flag: paths}, label=verb))

    def flag_layer(self, flag: str, layer: int, others: Sequence[int] = ()) -> None:
        """Hide or lock a layer of decals, or show or unlock it; others likewise."""
        document, layers = self._state.session.document, {layer, *others}
        if flag == "locked":
            present = {*document.locked_layers}
            locked = sorted(present - layers if layer in present else present | layers)
            self._state.run(LockLayers(locked, "lock" if layer in locked else "unlock"))
        elif layer in document.hidden.decals.layers:
            self._state.run(ShowDecals(sorted(layers)))
        else:
            if not len(document.decals_of_layer(layer)):
                raise InvalidEdit(f"layer: expected one with decals, got {describe(layer)}")
            self._state.run(HideDecals(document.decals_of_layer(*layers)))

    def isolate_layer(self, layer: int) -> None:
        """Hide the decals of all other layers and show those of the layer; if so already, show all."""
        session = self._state.session
        document = session.document
        others = np.setdiff1d(document.decals.numbers, document.decals_of_layer(layer))
        hidden = layer in document.hidden.decals.layers
        with session.stroke("isolate a layer" if len(others) or hidden else "show all"):
            session.do(ShowDecals([layer] if len(others) or hidden else None))
            session.do(HideDecals(others))
