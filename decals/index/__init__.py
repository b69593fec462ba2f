"""The decal index: which decals can reach a point, as a hierarchical hash grid that can be edited.

The public names are listed in `__init__.pyi` and are loaded at first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
