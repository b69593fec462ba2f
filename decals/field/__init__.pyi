from .batch import BatchSamples
from .evaluate import Samples
from .query import MaterialSamples, Neighbors
from .walks import Walks

__all__ = [
    "BatchSamples",
    "MaterialSamples",
    "Neighbors",
    "Samples",
    "Walks",
]
