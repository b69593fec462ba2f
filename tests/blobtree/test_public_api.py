"""The public names of blobtree."""

import inspect

import blobtree


def test_public_names_are_sorted_complete_and_documented() -> None:
    names = [name for name in blobtree.__all__ if name != "__version__"]
    assert sorted(blobtree.__all__) == sorted({*names, "__version__"})
    assert set(names) <= set(dir(blobtree))
    for name in names:
        value = getattr(blobtree, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert value.__doc__, name
            assert value.__module__.startswith("blobtree.")


def test_the_version_is_that_of_the_distribution() -> None:
    assert blobtree.__version__.count(".") >= 1
