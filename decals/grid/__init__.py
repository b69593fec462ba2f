"""Which decals can reach a point: a hierarchical hash grid, and edits of its own bytes."""
