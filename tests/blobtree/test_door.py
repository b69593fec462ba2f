"""The public door."""

import inspect

import blobtree


def test_the_door_is_sorted_complete_and_documented() -> None:
    names = blobtree.__all__
    assert names == sorted(names, key=lambda name: (not name.isupper(), not name[0].isupper(), name))
    assert len(set(names)) == len(names)
    public = {
        name
        for name, value in vars(blobtree).items()
        if not name.startswith("_") and not inspect.ismodule(value)
    }
    assert public | {"polygonize"} == set(names)
    for name in names:
        value = getattr(blobtree, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert value.__doc__, name
            assert value.__module__.startswith("blobtree.")
