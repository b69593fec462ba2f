"""Where decals go: one population of particles that repel each other on all surfaces at once."""
