"""What decides how neighbours push the owner of a point: a contact mode, or a law in place of one."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from blobtree.declare.registry import Definitions
from blobtree.identity import Value
from decals.errors import ImplicitDecalsError
from decals.record import Contact
from decals.validation import member


class Formulas(Protocol):
    """The formulas of decals with functions of a law in them."""

    def copy_of(self, formula: Any) -> Any:
        """Return a formula or a kernel of decals with this law; itself if it does not depend on it."""


@dataclass(frozen=True, eq=False)
class ContactLaw(Value):
    """A decal field g and a contact law h in place of the paper's; `define_contact` makes one.

    It stands for a contact mode in `evaluate`, `render`, `bake`, `measure` and `Drawing`.

    Attributes
    ----------
    name : str
        Its name in files.
    base : Contact
        PRODUCT or MIN: how the effects of several neighbours act together.
    rim : float
        Distance with g = ½, over that where g ends.
    digest : str
        Digest of all of that.
    formulas : Formulas
        The formulas of decals with g and h in them.
    restore : callable
        Function that pickles name: from a name, a mode, a digest and a module to the law.
    module : str
        Module that defines g or h.

    Examples
    --------
    >>> import decals
    >>> law = decals.define_contact("gaussian", combine="min")
    >>> law.name, law.base
    ('gaussian', <Contact.MIN: 1>)
    """

    name: str
    base: Contact
    rim: float
    digest: str
    formulas: Formulas = field(repr=False, compare=False)
    restore: Callable[..., Any] = field(repr=False, compare=False)
    module: str = field(default="", repr=False, compare=False)

    def __int__(self) -> int:
        return int(self.base)

    def __reduce__(self) -> tuple[Any, ...]:
        return self.restore, (self.name, self.base.name.lower(), self.digest, self.module)


AnyContact = Contact | ContactLaw
"""A contact mode, or a law in place of one."""

LAWS: Definitions[ContactLaw] = Definitions("contact law")
"""The laws that were defined, by name."""


def with_law(formula: Any, contact: AnyContact) -> Any:
    """Return a formula or a kernel of decals for a contact mode, or with the functions of a contact law."""
    return contact.formulas.copy_of(formula) if isinstance(contact, ContactLaw) else formula


def contact_mode(value: Any, error: type[ImplicitDecalsError]) -> AnyContact:
    """Return a contact mode, which may be given by its name, or a law; raise an error for other values."""
    return value if isinstance(value, ContactLaw) else member("contact", value, Contact, error)
