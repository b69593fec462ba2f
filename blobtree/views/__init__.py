"""Meshes and slices as pyvista objects."""
