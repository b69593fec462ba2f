from .evaluate import MaterialSamples, Neighbors, Samples
from .walks import Walks

__all__ = [
    "MaterialSamples",
    "Neighbors",
    "Samples",
    "Walks",
]
