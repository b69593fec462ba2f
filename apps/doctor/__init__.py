"""Checks of the software and hardware that the project needs."""
