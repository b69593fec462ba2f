"""Further sorts of models, and parts of trees that are small beside the whole; both may be left out."""

from typing import Any

from blobtree.lazy import if_present

READERS: dict[str, Any] = {}
"""What reads a mesh file, a tree, a dataset of pyvista, and the colours of a mesh of trimesh."""

SMALL_PARTS: dict[str, Any] = {}
"""What finds small parts of a tree, tells which part is nearest to a point, and meshes them finely."""

with if_present():
    from decals.surfaces.mesh_file import dataset_mesh, read_mesh_data
    from decals.surfaces.trimesh_colors import trimesh_color

    READERS |= {"file": read_mesh_data, "dataset": dataset_mesh, "trimesh": trimesh_color}
with if_present():
    import blobtree.foreign

    # the kinds of nodes that it knows take half a second to import
    READERS["tree"] = lambda path: blobtree.foreign.read_tree(path)
with if_present():
    from decals.surfaces.tree_parts import has_small_parts, nearest_leaves, polygonize_parts

    SMALL_PARTS |= {"find": has_small_parts, "nearest": nearest_leaves, "mesh": polygonize_parts}
