"""Declarations of kinds: what each class of nodes says about itself, and where it is found by name."""
