"""The rules of a picture: contact, image mapping, stiffness and filter as one value, from call to shader."""

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Annotated, Any, Self

from decals.errors import InvalidScene
from decals.field.contact_mode import AnyContact, contact_mode
from decals.field.mapping import ImageMapping
from decals.options import Values
from decals.record import DEFAULT_CONTACT, DEFAULT_STIFFNESS
from decals.validation import instance, member, stiffness_number


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
