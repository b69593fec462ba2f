"""Sparse blocks of cells, each with the part of the tape that acts in it."""
