"""The rules of a picture: contact, image mapping, stiffness and filter as one value, from call to shader.

What decides how neighbours push the owner of a point is a contact mode, or a law in place of one.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Annotated, Any, Protocol, Self

from blobtree.declare.registry import Definitions
from blobtree.identity import Value
from decals.errors import ImplicitDecalsError, InvalidScene
from decals.field.mapping import ImageMapping
from decals.options import Values
from decals.record import DEFAULT_CONTACT, DEFAULT_STIFFNESS, Contact
from decals.validation import instance, member, stiffness_number


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


@dataclass(frozen=True, kw_only=True)
class PictureRules:
    """How decals share a surface and how their images lie on it, in pictures and in evaluations.

    Parameters
    ----------
    contact : Contact, str or ContactLaw
        Contact mode: how decals that push each other share the surface; ``"elastic"``, ``"product"`` (the
        paper), ``"min"`` or ``"radial"``.
    mapping : ImageMapping or str
        Image mapping: how images lie on curved surface; ``"corrected"``, ``"chord"`` or ``"walked"``.
    stiffness : float
        Stiffness of elastic contact, from 1: how close to contact lines images are compressed.
    filtered : bool
        Average images, rims and contact lines over each sample, so that they are smooth with one sample a
        pixel. Silhouettes and light still need several.

    Raises
    ------
    InvalidScene
        If a rule is of another type, or out of range.

    Examples
    --------
    >>> from decals.field.rules import PictureRules
    >>> PictureRules(contact="min").overridden(stiffness=3, mapping=None).stiffness
    3.0
    """

    contact: AnyContact = DEFAULT_CONTACT
    mapping: ImageMapping = ImageMapping.CORRECTED
    stiffness: Annotated[float, Values(1.0, 8.0)] = DEFAULT_STIFFNESS
    filtered: bool = False

    if TYPE_CHECKING:  # names of modes are converted

        def __init__(
            self,
            *,
            contact: AnyContact | str = DEFAULT_CONTACT,
            mapping: ImageMapping | str = ImageMapping.CORRECTED,
            stiffness: float = DEFAULT_STIFFNESS,
            filtered: bool = False,
        ) -> None: ...

    def __post_init__(self) -> None:
        self._set(
            contact=contact_mode(self.contact, InvalidScene),
            mapping=member("mapping", self.mapping, ImageMapping, InvalidScene),
            stiffness=stiffness_number(self.stiffness, InvalidScene),
            filtered=instance("filtered", self.filtered, bool, InvalidScene, "such as True"),
        )

    def _set(self, **checked: object) -> None:
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def rules(self) -> "PictureRules":
        """These rules alone, of a value that has more."""
        return PictureRules(**{rule.name: getattr(self, rule.name) for rule in fields(PictureRules)})

    @property
    def modes(self) -> dict[str, Any]:
        """Contact, image mapping and stiffness, as arguments of `decals.evaluate`."""
        return {"contact": self.contact, "mapping": self.mapping, "stiffness": self.stiffness}

    @property
    def walked(self) -> bool:
        """True if the image mapping needs walks of the decals."""
        return self.mapping is ImageMapping.WALKED

    def overridden(self, **options: Any) -> Self:
        """Return the same with those of these options that are not None; errors are those of the class."""
        return replace(self, **{name: value for name, value in options.items() if value is not None})

    def apply(self, indexed: Any) -> None:
        """Write stiffness and image mapping to decals on a device, an `IndexedDecals`."""
        indexed.stiffness, indexed.mapping = self.stiffness, int(self.mapping)
