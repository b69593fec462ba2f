"""Editing scenes: commands, one stack to undo them, and tools that make commands of what hands do.

No graphics and no window are needed here; `decals.window` brings both.
"""

from decals.edit.actions import Actions
from decals.edit.background import Background
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
from decals.edit.jobs import Job, Worker
from decals.edit.objects import AddObject, RemoveObject
from decals.edit.outlines import outline
from decals.edit.pick import Pick, pick
from decals.edit.places import Places, first_hit, nearest
from decals.edit.population import Coat, Relax, Scatter
from decals.edit.primitives import MovePrimitive, PaintPrimitive, ResizePrimitive
from decals.edit.session import Command, EditSession
from decals.edit.shapes import AddPrimitive, DuplicatePrimitive, Join, JoinPrimitive, RemovePrimitive
from decals.edit.tools import Tools
from decals.edit.trees import primitive_near, primitive_paths

__all__ = [
    "Actions",
    "Add",
    "AddImage",
    "AddObject",
    "AddPrimitive",
    "Alter",
    "Background",
    "Carry",
    "Change",
    "ChangeImage",
    "Coat",
    "Command",
    "Delete",
    "Document",
    "Duplicate",
    "DuplicatePrimitive",
    "EditSession",
    "Job",
    "Join",
    "JoinPrimitive",
    "Look",
    "MovePrimitive",
    "PaintPrimitive",
    "Parts",
    "Pick",
    "Places",
    "Relax",
    "RemoveImage",
    "RemoveObject",
    "RemovePrimitive",
    "ResizePrimitive",
    "Rows",
    "Scale",
    "Scatter",
    "Tools",
    "Turn",
    "Worker",
    "first_hit",
    "nearest",
    "outline",
    "pick",
    "primitive_near",
    "primitive_paths",
]
