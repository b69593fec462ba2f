"""What people can get wrong on the command line."""


class UsageError(ValueError):
    """An argument that cannot be used; the message says what was expected, what came and what to do."""
