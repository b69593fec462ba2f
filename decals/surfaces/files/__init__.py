"""Readers of mesh files: a module for each format, and one for what their contents have in common.

Each reader checks all that it reads. A declared face is returned, or named in an error or in the log.
"""
