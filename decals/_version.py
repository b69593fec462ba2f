"""Version of the installed distribution, which holds both packages."""

from blobtree._version import __version__

__all__ = ["__version__"]
