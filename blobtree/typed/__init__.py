"""Typed functions as source: to GLSL, to plain Python, made anew for other tables."""
