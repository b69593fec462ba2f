"""Particles to decals: sizes, tangents, images, disorder."""
