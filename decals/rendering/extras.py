"""Extensions of the renderer, in a fixed order: effects, and classes that draw kinds of objects.

The first class that fits an object draws it. Effects may be left out.
"""

from blobtree.lazy import if_present
from decals.rendering.computed_mesh import mesh_drawable, mesh_warmup
from decals.rendering.drawable import register
from decals.rendering.effect import BUFFERS, EFFECTS
from decals.rendering.mesh import ColoredMesh
from decals.rendering.tree import TreeDrawable, TreeHolder

with if_present():
    import decals.rendering.filter_library  # noqa: F401  (registers its functions)
with if_present():
    from decals.rendering.posed_mesh import PosedColoredMesh, PosedMeshDrawable
    from decals.rendering.rest_buffer import RestBuffer

    BUFFERS["rest"] = RestBuffer
    register(PosedColoredMesh, PosedMeshDrawable, PosedMeshDrawable.warmup)
register(ColoredMesh, mesh_drawable, mesh_warmup)
register(TreeHolder, TreeDrawable, TreeDrawable.warmup)
with if_present():
    from decals.rendering.environment_textures import EnvironmentEffect
    from decals.rendering.materials import HeightEffect, MaterialEffect
    from decals.rendering.offset_tree import OffsetTreeDrawable
    from decals.rendering.walk_cache import WalkEffect

    EFFECTS |= {
        "materials": MaterialEffect,
        "relief": HeightEffect,
        "walks": WalkEffect,
        "environment": EnvironmentEffect,
    }
    register(TreeHolder, OffsetTreeDrawable, OffsetTreeDrawable.warmup)
