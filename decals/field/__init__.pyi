from .batch import BatchSamples
from .evaluate import Samples
from .image_texels import MaterialSamples
from .query import Neighbors
from .walks import Walks

__all__ = [
    "BatchSamples",
    "MaterialSamples",
    "Neighbors",
    "Samples",
    "Walks",
]
