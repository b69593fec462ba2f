"""Further answers of a query, and log maps of decals; both may be left out."""

from typing import Any

from blobtree.lazy import if_present

ANSWERS: dict[str, Any] = {}
"""What a `Query` can be asked beside its samples, by the parameter of `evaluate`."""

WALKS: dict[str, Any] = {}
"""What makes the walks of decals over objects for a mapping; see `walks_for`."""

with if_present():
    from decals.field.jacobian import jacobians
    from decals.field.neighbor_lists import neighbors

    ANSWERS |= {"jacobian": jacobians, "neighbors": neighbors}
with if_present():
    from decals.field.walks import walks_for

    WALKS["for"] = walks_for
