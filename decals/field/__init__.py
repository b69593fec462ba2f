"""The decal function: who shows at a point of a surface, in which order, and how its neighbours push it."""
