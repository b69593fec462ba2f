"""The level of the surface."""

ISO = 0.5
"""Field value on the surface; the field is larger inside."""
