"""Zones in an editor: other decals on the surface of the selected nodes, or around the selected decals."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree.nodes.paths import Path, node_at
from blobtree.progress import Progress
from decals.editing.action_state import WindowActions
from decals.editing.brushes import positive_number
from decals.editing.decal_actions import FIRST_DECAL_COUNT
from decals.editing.document import Document
from decals.editing.queries import nearest_points
from decals.editing.scatter_commands import ScatterDecals
from decals.editing.session import Command
from decals.errors import InvalidEdit
from decals.options import Values
from decals.scattering.domain import Domain, Mask
from decals.scattering.zones import Zone, Zones
from decals.scenes.objects import SceneObject, TreeObject

LEAST_DENSITY = 0.1
"""Low end of the slider of a zone's density; the high end is its reciprocal."""


class ZoneActions(WindowActions):
    """Scatters decals in the zone that is selected; decals elsewhere stay."""

    def scatter(
        self,
        count: int | None,
        seed: int,
        zone_density: Annotated[
            float, Values(LEAST_DENSITY, 1.0 / LEAST_DENSITY, label="zone density")
        ] = 1.0,
        **options: Any,
    ) -> None:
        """Replace the decals in a zone by scattered ones, and select these.

        The zone is the surface nearest to the selected decals. If none is selected, it is the surface of the
        selected nodes.

        Parameters
        ----------
        count
            Number of decals for the objects as a whole, of which the zone gets its share by area, one at
            least. None stands for as many as there are, or 100.
        seed
            Random seed.
        zone_density
            Density in a zone, relative to that which the count gives; other scattering leaves it out.
        options
            Those of `ScatterDecals`.
        """
        state, document = self._state, self._state.session.document
        density = positive_number("zone density", zone_density)
        whole = (len(document.decals) or FIRST_DECAL_COUNT) if count is None else count
        ScatterDecals((), whole, seed, options).check_values()
        objects, images, first = document.objects, len(document.images), document.decals.next_number
        nodes, selection = state.nodes, state.selection
        if not (nodes or selection):
            raise InvalidEdit("no zone is selected; click on a part of the model, or select decals")
        zone = zone_of_decals(document, selection) if selection else None
        places = document.decals.take(np.array(selection, np.int64)).positions
        replaced = f"in place of {len(selection)} decal{'' if len(selection) == 1 else 's'}"
        label = f"scatter {f'on {name_of_parts(objects, nodes)}' if zone is None else replaced}"

        def compute(progress: Progress, cancel: Callable[[], bool]) -> Command:
            on = [number for number, _ in nodes] if zone is None else nearest_points(objects, places).objects
            numbers = tuple(np.unique(on).tolist())
            items = [objects[number] for number in numbers]
            mask = zone_of_nodes(objects, nodes) if zone is None else zone
            wanted = max(1, round(whole * density * share_of_area(items, mask)))
            command = ScatterDecals(numbers, wanted, seed, options, mask)
            made = command.compute_command(objects, images, progress=progress, cancel=cancel)
            return replace(made, label=label)

        def select() -> None:
            state.primitive = None
            state.selection = tuple(range(first, state.session.document.decals.next_number))

        state.background.compute(label, compute, select)


def name_of_parts(objects: Sequence[SceneObject], nodes: Sequence[tuple[int, Path]]) -> str:
    """Return the name of a node, else of its class; the number of nodes if there are more."""
    (number, path), *others = nodes
    if others:
        return f"{len(nodes)} parts"
    item = objects[number]
    assert isinstance(item, TreeObject)  # meshes have no nodes
    return item.names.get(path, type(node_at(item.tree, path)).__name__)


def zone_of_decals(document: Document, numbers: ArrayLike) -> Mask:
    """Return the zone of decals: a function that is True for points (n, 3) nearest to one of them."""
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    tree, chosen = cKDTree(document.decals.decals.positions), np.isin(document.decals.numbers, numbers)
    return lambda points: chosen[tree.query(points)[1]]


def zone_of_nodes(objects: Sequence[SceneObject], nodes: Sequence[tuple[int, Path]]) -> Mask:
    """Return the zone of nodes: a function that is True for points (n, 3) of the surface that they make."""
    items, zones = [], []
    for number, path in nodes:
        item = objects[number]
        assert isinstance(item, TreeObject)  # meshes have no nodes
        items.append(item)
        zones.append(Zone(node_at(item.tree, path)))
    return Zones(*zones).placed_on(items).mask


def share_of_area(objects: Sequence[SceneObject], mask: Mask) -> float:
    """Return the share of the visible area of objects where a mask is True."""
    surfaces = [item.surface for item in objects]
    return Domain(surfaces, 0, mask=mask).area / Domain(surfaces, 0).area
