"""`content_hash` among the names of this package; `blobtree.identity` computes it."""

from blobtree.identity import content_hash

__all__ = ["content_hash"]
