"""All decals that act at the points of a query, as lists; the answer `neighbors` of `evaluate`."""

from typing import Any

import numpy as np
import warp as wp

from decals.field.query import Neighbors, Query, zeros


def neighbors(query: Query) -> Neighbors:
    """Return all decals with a field at points; the index lists whole influences, not only reaches."""
    from decals.field.neighbor_kernels import (  # compiled at the first use
        SHOWS_ALONE,
        SHOWS_IN_LAYER,
        list_neighbors,
    )

    device, count = query.device, query.count
    target, known = query.target.wide()
    empty = zeros(device, 0, wp.int32, wp.float32)
    (counts,) = zeros(device, count, wp.int32)
    owners = query.host_owners
    if known is not None:
        owners = np.where(owners >= 0, np.searchsorted(known, owners), owners).astype(np.int32)
    placed: Any = wp.array(owners, dtype=wp.int32, device=device)
    given = [query.points, query.normals, int(query.contact), *target.arguments(), placed]
    query.launch(list_neighbors, [*given, empty[0]], [counts, empty[0], empty[1], empty[1], empty[0]])
    offsets = np.concatenate([[0], np.cumsum(counts.numpy(), dtype=np.int64)])
    starts: Any = wp.array(offsets[:-1], dtype=wp.int32, device=device)
    total = int(offsets[-1])
    lists = zeros(device, total, wp.int32, wp.float32, wp.float32, wp.int32)
    if total:
        query.launch(list_neighbors, [*given, starts], [counts, *lists])
    order = np.lexsort((lists[0].numpy(), np.repeat(np.arange(count), np.diff(offsets))))
    found, fields, pushes, shows = (values.numpy()[order] for values in lists)
    numbers = found if known is None else known[found].astype(np.int32)
    alone, in_layer = ((shows & bit) > 0 for bit in (SHOWS_ALONE, SHOWS_IN_LAYER))
    return Neighbors(offsets, numbers, fields, pushes, alone, in_layer)
