from .evaluate import Neighbors, Samples

__all__ = [
    "Neighbors",
    "Samples",
]
