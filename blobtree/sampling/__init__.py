"""Triangle meshes and fields as grids of signed distances."""
