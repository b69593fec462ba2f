"""Tree to tape, and the one loop that reads it: value, slope bound, gradient, colour."""
