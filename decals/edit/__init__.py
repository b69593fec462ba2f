"""Editing scenes: commands, one stack to undo them, and tools that make commands of what hands do.

No graphics and no window are needed here; `decals.window` brings both.
"""

from decals.edit.change import Change, Parts, Rows
from decals.edit.commands import (
    Add,
    AddImage,
    Alter,
    Carry,
    ChangeImage,
    Delete,
    Duplicate,
    Look,
    RemoveImage,
    Scale,
    Turn,
)
from decals.edit.document import Document
from decals.edit.places import Places, first_hit, nearest
from decals.edit.population import Coat, Relax, Scatter
from decals.edit.session import Command, EditSession
from decals.edit.trees import MovePrimitive, PaintPrimitive, ResizePrimitive, primitive_near, primitive_paths

__all__ = [
    "Add",
    "AddImage",
    "Alter",
    "Carry",
    "Change",
    "ChangeImage",
    "Coat",
    "Command",
    "Delete",
    "Document",
    "Duplicate",
    "EditSession",
    "Look",
    "MovePrimitive",
    "PaintPrimitive",
    "Parts",
    "Places",
    "Relax",
    "RemoveImage",
    "ResizePrimitive",
    "Rows",
    "Scale",
    "Scatter",
    "Turn",
    "first_hit",
    "nearest",
    "primitive_near",
    "primitive_paths",
]
