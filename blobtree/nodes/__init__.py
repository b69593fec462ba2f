"""Immutable nodes: what people write, combine, print and save."""
