"""Tests of fields and distances on grids."""
