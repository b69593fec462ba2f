"""`KnownAttributes`: a misspelt setting is refused, not ignored."""

from typing import TYPE_CHECKING, Any

from decals.errors import InvalidScene


class KnownAttributes:
    """Base of classes with settings: an attribute that the class does not declare cannot be set.

    Public attributes are annotated in the class, or are properties. `_elsewhere` is the name of the attribute
    that has other settings.
    """

    _elsewhere = ""

    if not TYPE_CHECKING:  # else mypy accepts all names

        def __setattr__(self, name: str, value: Any) -> None:
            kind = type(self)
            if not (name.startswith("_") or name in kind.__annotations__ or hasattr(kind, name)):
                settings = ", ".join(key for key in dir(kind) if getattr(getattr(kind, key), "fset", None))
                message = f"expected one of the settings {settings}, got {name!r}"
                if self._elsewhere and hasattr(type(getattr(self, self._elsewhere)), name):
                    message += f"; set `{self._elsewhere}.{name}` instead"
                raise InvalidScene(message)
            super().__setattr__(name, value)
