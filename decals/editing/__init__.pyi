from .actions import KEYS, Actions
from .brushes import BrushDecals, PushDecals
from .commands import (
    AddDecals,
    AddImage,
    DeleteDecals,
    DuplicateDecals,
    MapValues,
    MoveDecals,
    RemoveImage,
    ReplaceImage,
    ReplaceScene,
    ScaleDecals,
    SetCamera,
    SetValues,
    TurnDecals,
)
from .document import Document
from .pointer_tools import PointerTools
from .queries import first_hit, nearest_points, outline, pick
from .recovery import recovery_path
from .scatter_commands import AddObject, RelaxDecals, RemoveObject, ReplaceDecals, ScatterDecals
from .session import EditSession, UndoEntry
from .tree_commands import (
    AddPrimitive,
    DuplicatePrimitive,
    JoinPrimitive,
    MovePrimitive,
    PaintPrimitive,
    RemovePrimitive,
    ReplaceNode,
    ResizePrimitive,
    SetParameter,
)

__all__ = [
    "KEYS",
    "Actions",
    "AddDecals",
    "AddImage",
    "AddObject",
    "AddPrimitive",
    "BrushDecals",
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
    "PushDecals",
    "RelaxDecals",
    "RemoveImage",
    "RemoveObject",
    "RemovePrimitive",
    "ReplaceDecals",
    "ReplaceImage",
    "ReplaceNode",
    "ReplaceScene",
    "ResizePrimitive",
    "ScaleDecals",
    "ScatterDecals",
    "SetCamera",
    "SetParameter",
    "SetValues",
    "TurnDecals",
    "UndoEntry",
    "first_hit",
    "nearest_points",
    "outline",
    "pick",
    "recovery_path",
]
