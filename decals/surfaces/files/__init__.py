"""Readers of files that place meshes in space: glTF 2.0 and 3MF, over `json`, XML and NumPy alone."""
