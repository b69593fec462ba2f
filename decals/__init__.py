"""Decals as implicit fields: images that touch, push and deform each other on any surface.

The public names are listed in `__init__.pyi` and are loaded at first use, so `import decals` is cheap.
"""

import sys
from functools import partial

from blobtree.lazy import attach_stub
from decals.shortcuts import provide

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
provide(partial(getattr, sys.modules[__name__]))
