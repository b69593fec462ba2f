import subprocess
import sys

import pytest

import decals


def test_every_name_is_there_and_sorted() -> None:
    assert decals.__all__ == sorted(decals.__all__)
    assert dir(decals) == decals.__all__
    for name in decals.__all__:
        assert getattr(decals, name) is not None


def test_the_list_for_type_checkers_is_the_list_that_is_loaded() -> None:
    assert sorted(decals._HOME_OF) == decals.__all__


def test_exported_classes_say_where_they_live() -> None:
    for name, home in decals._HOME_OF.items():
        module = getattr(getattr(decals, name), "__module__", f"decals.{home}")
        assert module.startswith(f"decals.{home}")


def test_unknown_names_are_attribute_errors() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        decals.nothing  # noqa: B018


def test_errors_alone_load_nothing_heavy() -> None:
    heavy = {"warp", "pyvista", "moderngl", "vtk"}
    code = f"import sys, decals.errors; print(sorted({heavy} & sys.modules.keys()))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
