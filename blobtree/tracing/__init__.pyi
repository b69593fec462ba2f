from .batch import BatchHits
from .trace import Hits

__all__ = [
    "BatchHits",
    "Hits",
]
