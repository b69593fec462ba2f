"""What `plotter.decals` does with VTK's own actors: decals on them, and exports that write them."""

from typing import Any

from blobtree.lazy import if_present

ACTORS: dict[str, Any] = {}
"""The class of decals on actors, and the functions that watch exports of a plotter and undo that."""

with if_present():
    from decals.vtk.exports import restore_exports, watch_exports
    from decals.vtk.injection import InjectedDecals

    ACTORS |= {"decals": InjectedDecals, "watch": watch_exports, "restore": restore_exports}
