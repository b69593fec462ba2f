"""Custom kinds of nodes, each defined by one typed function."""
