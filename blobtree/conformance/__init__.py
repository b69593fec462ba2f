"""Conformance: laws of kinds, tried on samples."""
