from .editor import DecalEditor
from .index import DecalIndex

__all__ = [
    "DecalEditor",
    "DecalIndex",
]
