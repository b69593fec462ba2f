from .evaluate import Neighbors, Samples
from .walks import Walks

__all__ = [
    "Neighbors",
    "Samples",
    "Walks",
]
