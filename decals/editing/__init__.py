"""Editing without a window: sessions with undo, commands, background jobs, actions and pointer tools.

`decals.window` puts the actions and pointer tools into a window.

The public names are listed in `__init__.pyi` and are loaded at first use.
"""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
