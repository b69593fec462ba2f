"""Blocks to closed triangles with their vertices on the surface, on its creases too."""
