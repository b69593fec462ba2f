"""Errors of the command line."""


class UsageError(ValueError):
    """An unusable argument; the message names the expected value, the actual one and a remedy."""
