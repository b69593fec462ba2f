"""Translation of typed functions: to GLSL, to plain Python, and to other tables."""
