"""The kinds of objects that can be drawn: the first that an object is like draws it."""

from decals.rendering.drawable import register
from decals.rendering.mesh import ColoredMesh, MeshDrawable
from decals.rendering.offset_tree import OffsetTreeDrawable
from decals.rendering.posed_mesh import PosedColoredMesh, PosedMeshDrawable
from decals.rendering.tree import TreeHolder

register(PosedColoredMesh, PosedMeshDrawable, PosedMeshDrawable.warmup)
register(ColoredMesh, MeshDrawable, MeshDrawable.warmup)
register(TreeHolder, OffsetTreeDrawable, OffsetTreeDrawable.warmup)
