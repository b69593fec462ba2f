"""Kinds of the core, one class each."""
