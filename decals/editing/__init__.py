"""Editing without a window: sessions with undo, commands, background jobs, actions and pointer tools.

`decals.window` puts the actions and pointer tools into a window.
"""

from decals.editing.actions import KEYS, Actions
from decals.editing.commands import (
    AddDecals,
    AddImage,
    DeleteDecals,
    DuplicateDecals,
    MapValues,
    MoveDecals,
    RemoveImage,
    ReplaceImage,
    ScaleDecals,
    SetCamera,
    SetValues,
    TurnDecals,
)
from decals.editing.document import Document
from decals.editing.outlines import outline
from decals.editing.pointer_tools import PointerTools
from decals.editing.queries import first_hit, nearest_points, pick
from decals.editing.scatter_commands import AddObject, RelaxDecals, RemoveObject, ReplaceDecals, ScatterDecals
from decals.editing.session import EditSession, UndoEntry
from decals.editing.tree_commands import (
    AddPrimitive,
    DuplicatePrimitive,
    JoinPrimitive,
    MovePrimitive,
    PaintPrimitive,
    RemovePrimitive,
    ResizePrimitive,
)

__all__ = [
    "KEYS",
    "Actions",
    "AddDecals",
    "AddImage",
    "AddObject",
    "AddPrimitive",
    "DeleteDecals",
    "Document",
    "DuplicateDecals",
    "DuplicatePrimitive",
    "EditSession",
    "JoinPrimitive",
    "MapValues",
    "MoveDecals",
    "MovePrimitive",
    "PaintPrimitive",
    "PointerTools",
    "RelaxDecals",
    "RemoveImage",
    "RemoveObject",
    "RemovePrimitive",
    "ReplaceDecals",
    "ReplaceImage",
    "ResizePrimitive",
    "ScaleDecals",
    "ScatterDecals",
    "SetCamera",
    "SetValues",
    "TurnDecals",
    "UndoEntry",
    "first_hit",
    "nearest_points",
    "outline",
    "pick",
]
