"""Triangle meshes of the surface in sparse cells, with vertices on the surface and on its creases."""
