"""Scenes: objects, decals, images and a camera, and their files. The public names are those of `decals`."""
