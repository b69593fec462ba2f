"""Experiments: a function over a design of trials, run in many processes, with results that resume.

The public names are listed in `__init__.pyi` and are loaded at first use.
"""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
