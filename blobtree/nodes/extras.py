"""The base class from which a node has all its methods; `Model` has the methods of the core alone."""

from typing import TYPE_CHECKING

from blobtree.lazy import if_present

if TYPE_CHECKING:
    from blobtree.nodes.questions import Questions as NodeMethods
else:
    from blobtree.nodes.model import Model as NodeMethods

    with if_present():
        from blobtree.nodes.questions import Questions as NodeMethods

__all__ = ["NodeMethods"]
