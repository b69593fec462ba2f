from .evaluate import Samples

__all__ = [
    "Samples",
]
