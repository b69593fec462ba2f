from .field_grid import FieldGrid
from .tree_distances import SignedDistances

__all__ = [
    "FieldGrid",
    "SignedDistances",
]
