"""Rays through sparse cells, with a proven step bound."""
