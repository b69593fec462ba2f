from .batch import DecalBatch
from .editor import DecalEditor
from .index import DecalIndex

__all__ = [
    "DecalBatch",
    "DecalEditor",
    "DecalIndex",
]
