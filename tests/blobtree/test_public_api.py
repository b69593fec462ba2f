"""The public names of blobtree."""

import inspect
from types import ModuleType

import pytest

import blobtree
from blobtree import custom, errors, library, sampling, tracing
from blobtree.declare.registry import NODE_KINDS, load_libraries


def test_public_names_are_sorted_complete_and_documented() -> None:
    names = [name for name in blobtree.__all__ if name != "__version__"]
    assert sorted(blobtree.__all__) == sorted({*names, "__version__"})
    assert set(names) <= set(dir(blobtree))
    for name in names:
        value = getattr(blobtree, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert value.__doc__, name
            assert value.__module__.startswith("blobtree.")


def test_the_library_lists_all_kinds_of_nodes_and_nothing_else() -> None:
    load_libraries()
    ours = {kind.__name__: kind for kind in NODE_KINDS.values() if kind.__module__.startswith("blobtree.")}
    assert library.__all__ == sorted(ours) == dir(library)
    for name, kind in ours.items():
        assert getattr(library, name) is getattr(blobtree, name) is kind
    assert set(library.__all__) < set(blobtree.__all__)


def test_the_version_is_that_of_the_distribution() -> None:
    assert blobtree.__version__.count(".") >= 1


@pytest.mark.parametrize("module", [custom, errors, sampling, tracing])
def test_names_that_moved_are_still_found(module: ModuleType) -> None:
    for name in set(module.__all__) - {"ImplicitDecalsError", "InvalidInput"}:
        assert name not in blobtree.__all__
        with pytest.warns(DeprecationWarning, match=f"{module.__name__}.{name}"):
            assert getattr(blobtree, name) is getattr(module, name)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="nothing"):
        blobtree.nothing  # type: ignore[attr-defined]  # noqa: B018
