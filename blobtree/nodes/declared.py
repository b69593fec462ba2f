"""Nodes whose class is a declaration: parameters, formulas and claims, from which their row follows."""

import inspect
from collections.abc import Mapping
from dataclasses import Field, dataclass
from typing import Any, ClassVar, Self

from blobtree.declare.formula import Declared, Formula, declared_formulas, is_own, require_claims, tag_of
from blobtree.declare.parameters import Parameter, documented, fields_of, parameters_of
from blobtree.declare.registry import CUSTOM_KINDS, CUSTOM_TAGS, LIBRARY_ROWS, CustomKind
from blobtree.errors import InvalidDefinition, InvalidNode
from blobtree.nodes.node import Node


class DeclaredNode(Node, metaclass=CustomKind):
    """A node of a class with formulas: what the sorts of kinds share."""

    kind: ClassVar[str]
    digest: ClassVar[str] = ""
    """Digest of the formulas, claims and parameters of a kind that this package does not define."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """The parameters of such a kind, without those of its base in this package."""
    sort: ClassVar[str]
    """What a kind is, in messages."""
    hash_name: ClassVar[str]
    """The name of a kind's sort in content hashes."""
    row_name: ClassVar[str]
    """The attribute of a class that holds its row."""
    formula_results: ClassVar[Mapping[str, Any]]
    """The formulas of this sort of kinds, and the types of their results."""
    needed: ClassVar[tuple[str, ...]] = ("value",)
    """Formulas of which a kind needs one."""
    common: ClassVar[tuple[str, ...]] = ()
    """Names of the parameters that all kinds of this sort declare."""
    methods: ClassVar[tuple[str, ...]] = ()
    """Methods of a class that belong to the meaning of its formulas."""
    custom_tags: ClassVar[tuple[str, ...]] = ()
    """Tags of users' kinds in files: that of today, then those of older files."""
    in_library: ClassVar[bool] = True
    """False for a kind of this package whose trees get kernels of their own, so that others stay small."""
    has_init: ClassVar[bool] = False
    """True if the base has the constructor."""
    _formulas: ClassVar[dict[str, Formula]] = {}

    def __init_subclass__(cls) -> None:
        own, declares = is_own(cls), any(isinstance(value, Declared) for value in vars(cls).values())
        CUSTOM_TAGS.update(dict.fromkeys(vars(cls).get("custom_tags", ()), cls))
        if not declares and (own or cls.row_name in vars(cls)):
            super().__init_subclass__()
            return
        if not own:
            require_claims(cls, cls.sort)
        tag = tag_of(cls)
        cls._formulas = {**cls._formulas, **declared_formulas(cls, tag, cls.formula_results)}
        if own and not cls.__name__.startswith("_"):  # no file holds a private kind: its parent is written
            cls.file_tag = tag
        elif not own:
            _require_free_names(cls)
        super().__init_subclass__()
        dataclass(frozen=True, eq=False, repr=False, init=not cls.has_init)(cls)
        if own:
            row = cls._declaration(tag).row()
            setattr(cls, cls.row_name, row)
            if cls.in_library and not getattr(row, "gradients", False):
                LIBRARY_ROWS.append(row)
        elif not cls._formulas.keys() & {*cls.needed}:
            raise InvalidDefinition(
                f"{cls.__qualname__}: expected {cls.sort} with the formula `{cls.needed[0]}`"
            )
        else:
            cls._define(cls._declaration(tag))

    def __new__(cls, *_: Any, **__: Any) -> Self:
        """Refuse a node of a base class, which has no formulas."""
        if getattr(cls, cls.row_name, None) is None:
            raise InvalidNode(f"{cls.__name__}: expected a subclass of it with the formula `{cls.needed[0]}`")
        return super().__new__(cls)

    @classmethod
    def _declaration(cls, tag: str) -> Any:
        """Return formulas and claims, with methods `require`, `digest` and `row`."""
        raise NotImplementedError

    @classmethod
    def _check(cls, declaration: Any) -> None:
        """Raise `InvalidDefinition` if samples contradict a user's kind."""
        raise NotImplementedError

    @classmethod
    def _define(cls, declaration: Any) -> None:
        """Check a user's kind, unless it is known, and register it."""
        declared = parameters_of(cls)
        known_fields = {*_fields_of_base(cls), *declared}
        unknown = [item.name for item in fields_of(cls) if item.name not in known_fields]
        if unknown:
            raise InvalidDefinition(
                f"{cls.__qualname__}: field {unknown[0]!r}: expected a specifier of blobtree.par, such as "
                f"`{unknown[0]}: float = par.factor('what it is')`"
            )
        cls.__doc__ = documented(cls.__doc__ or "", cls)
        shared = {*cls.common, *_fields_of_base(cls)}
        cls.kind = declaration.kind
        cls.parameters = tuple(p for name, p in declared.items() if name not in shared)
        numbers = getattr(cls, "numbers", cls)
        declaration.require([p.name for p in cls.parameters] if is_own(numbers) or numbers is cls else None)
        methods = [getattr(cls, name) for name in cls.methods]
        sources = [_source_text(method) for method in methods if method is not None and not is_own(method)]
        cls.digest = declaration.digest((*cls.parameters, *sources))
        known: Any = CUSTOM_KINDS.get(cls.kind)
        if (
            known is not None
            and getattr(known, "row_name", "") == cls.row_name
            and known.digest == cls.digest
        ):
            setattr(cls, cls.row_name, getattr(known, cls.row_name))
        else:
            cls._check(declaration)
            setattr(cls, cls.row_name, declaration.row(cls.digest))
        CUSTOM_KINDS[cls.kind] = cls

    @classmethod
    def content_key(cls) -> tuple[str, ...]:
        """Return what names the kind in content hashes: with the digest of a user's formulas."""
        return (cls.hash_name, cls.kind, cls.digest) if cls.digest else super().content_key()

    @property
    def values(self) -> dict[str, Any]:
        """The parameters by name; of a user's kind those that its base does not have."""
        names = [p.name for p in self.parameters] if self.digest else parameters_of(type(self))
        return {name: getattr(self, name) for name in names}


def _source_text(method: Any) -> str:
    """Return the source of a method, or else a text that differs between methods."""
    try:
        return inspect.getsource(method)
    except (OSError, TypeError):
        return repr(method)


def _fields_of_base(kind: type) -> dict[str, Any]:
    """Return the fields of the nearest base of a kind in this package, by name."""
    base = next(base for base in kind.__mro__[1:] if is_own(base))
    return getattr(base, "__dataclass_fields__", {})


def _require_free_names(kind: type[DeclaredNode]) -> None:
    """Raise `InvalidDefinition` if a parameter has the name of what each node has."""
    base = next(base for base in kind.__mro__[1:] if is_own(base))
    taken = {"operands", *kind.formula_results, *_fields_of_base(kind)}
    for name, value in vars(kind).items():
        if isinstance(value, Field) and (hasattr(base, name) or name in taken):
            raise InvalidDefinition(
                f"{kind.__qualname__}: parameter {name!r}: every node of this sort has an attribute of that "
                "name; choose another"
            )
