"""Core and extras: the files that a reader of the core may leave out, and the imports that still reach them.

The core is what a BlobTree is, how it becomes a mesh, rays and particles, and one decal pass. An extra is a
folder of the product, or a file, on which the core should not depend.
"""

from tests.import_graph import module_graph

EXTRAS: dict[str, str] = {
    "blobtree": "field_slice fitting slicing",
    "blobtree.conformance": "*",
    "blobtree.custom": "field",
    "blobtree.derivatives": "*",
    "blobtree.foreign": "*",
    "blobtree.formulas": """
        falloffs noise
        """,
    "blobtree.meshing": """
        adaptive adaptive_cell_kernels adaptive_cells adaptive_kernels adaptive_mesh batch
        block_tree chord_error clip crease_branches crease_intersections crease_kernels
        crease_sheets creases crumbs distance_kernels gap_kernels gaps leaf_changes leaf_gaps
        part_kernels parts thickening thickening_kernels thin_parts wall_kernels walls
        """,
    "blobtree.nodes": """
        blends clauses contact convolution courses crossings curves deformations drawings expressions
        fields flats outlines parameter_gradient pieces profiles questions repeats rounds samples
        sections sharp solids sweeps tree_volumes unions volumes
        """,
    "blobtree.sampling": "*",
    "blobtree.tape": "attributes directed directed_along grown operands part_sizes poses rest_kernels",
    "decals.baking": "*",
    "decals.editing": """
        bare_watch brush_actions brushes filling outline_actions overlays scatter_on_copies slicing visibility
        visibility_actions zone_actions
        """,
    "decals.experiments": "*",
    "decals.field": """
        batch batch_kernels batch_neighbor_kernels jacobian law neighbor_kernels neighbor_lists pixel_filter
        walk_kernels walks
        """,
    "decals.hosts": "*",
    "decals.images": "radiance",
    "decals.index": "batch",
    "decals.pages": "*",
    "decals.rendering": """
        environment_textures filter_library materials offset_tree posed_mesh prefiltering rest_buffer
        walk_cache
        """,
    "decals.scattering": """
        bare_places center_normals copies covering creases deform density gap_filling
        image_projections owned_points polish rearrangement relocation remesh seen sheets zones
        """,
    "decals.scenes": """
        animation area_gradient figure gaps measure outlines pose reproduction
        script tables
        """,
    "decals.surfaces": """
        dataset_colors mesh_check mesh_file tree_parts trimesh_colors vtk_child vtk_process
        """,
    "decals.surfaces.files": "*",
    "decals.vtk": "actor_object exports injection mapper",
    "decals.window": "browser notebook opening view_modes",
}
"""The modules of each package that are extras, ``*`` for all."""

LISTS = (
    "blobtree.library",
    "blobtree.meshing.polygonize",
    "blobtree.nodes.extras",
    "blobtree.nodes.kinds",
    "blobtree.tape.extras",
    "decals.editing.actions",
    "decals.editing.formats",
    "decals.field.extras",
    "decals.images.extras",
    "decals.rendering.extras",
    "decals.scattering.extras",
    "decals.surfaces.extras",
    "decals.vtk.extras",
)
"""Modules that list kinds of nodes, ways of meshing, actions, formats, refinements, and other extras."""


def is_extra(module: str) -> bool:
    """Return True for a module of `blobtree` or `decals` that is an extra."""
    package, _, name = module.rpartition(".")
    return "*" in (EXTRAS.get(module), EXTRAS.get(package)) or name in EXTRAS.get(package, "").split()


def core_to_extras() -> list[tuple[str, str]]:
    """Return the pairs of a core module and an extra that it imports, at its own import or later.

    Applications, lists of kinds and the public names of packages do not count.
    """
    graph = module_graph()
    packages = {name.rpartition(".")[0] for name in graph}
    counted = (
        name
        for name in graph
        if name.split(".")[0] in ("blobtree", "decals")
        and not name.startswith(("decals.apps", "decals.shaders"))
        and name not in packages
        and name not in LISTS
        and not is_extra(name)
    )
    return [(name, target) for name in sorted(counted) for target in sorted(graph[name]) if is_extra(target)]
