"""Kinds of nodes of one's own, each from one typed function."""
