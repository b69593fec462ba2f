"""The rooms of the project: what each may import, and that the package lists them all."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = {
    "blobtree": "blobtree",
    "decals": "decals",
    "apps": "implicit_decals.apps",
    "shaders": "implicit_decals.shaders",
}
OURS = set(ROOMS.values())
DRAWING = {"moderngl", "vtk", "vtkmodules", "pyvista"}
FORBIDDEN = {
    "blobtree": {"decals", "implicit_decals.apps", "implicit_decals.shaders", *DRAWING},
    "decals": {"implicit_decals.apps"},
    "shaders": {"blobtree", "decals", "implicit_decals.apps", *DRAWING},
    "apps": {"tests"},
}
VIEWS = ("views", "pyvista")
"""The one room of `blobtree` that makes pyvista objects; another test sees to it that it imports it late."""


@cache
def project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def files(room: str) -> list[Path]:
    return sorted((ROOT / room).rglob("*.py"))


def imports(path: Path) -> Iterator[str]:
    """Yield what a file imports from elsewhere, by its full name."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


@pytest.mark.parametrize("room", ROOMS)
def test_imports_run_one_way(room: str) -> None:
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files(room)
        for name in imports(path)
        if any(within(name, package) for package in FORBIDDEN[room]) and (path.parent.name, name) != VIEWS
    ]
    assert not wrong


def test_every_imported_distribution_is_a_declared_dependency() -> None:
    declared = {re.split("[>=<]", line)[0] for line in project()["project"]["dependencies"]}
    providers = metadata.packages_distributions()
    for room in ROOMS:
        for path in files(room):
            for name in imports(path):
                top = name.split(".")[0]
                if top in sys.stdlib_module_names or any(within(name, ours) for ours in OURS):
                    continue
                assert declared & set(providers.get(top, ())), f"{path.relative_to(ROOT)} imports {top}"


@pytest.mark.parametrize("room", ROOMS)
def test_every_folder_of_code_is_packaged(room: str) -> None:
    packages = project()["tool"]["setuptools"]["packages"]
    for path in files(room):
        folders = path.parent.relative_to(ROOT / room).parts
        assert ".".join([ROOMS[room], *folders]) in packages


def test_every_room_is_typed() -> None:
    assert all((ROOT / room / "py.typed").is_file() for room in ROOMS)


def test_only_files_of_kernels_are_excused_from_types() -> None:
    excused = project()["tool"]["mypy"]["overrides"][0]["module"]
    assert excused == sorted(excused)
    for name in excused:
        source = (ROOT / name.replace(".", "/")).with_suffix(".py").read_text(encoding="utf-8")
        assert re.search(r"^\s*@(wp\.(func|kernel)|unrolled)", source, re.MULTILINE), name
