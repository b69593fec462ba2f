"""Baking: scenes as GLB files, with the decals in a texture or in vertex colours."""
