"""The packages of the project: what each may import, and that pyproject.toml lists them all."""

import re
import shutil
import subprocess
import sys
import tomllib
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import LONG_FILES
from tests.core_and_extras import EXTRAS as EXTRA_MODULES
from tests.core_and_extras import core_to_extras
from tests.import_graph import (
    FOLDERS,
    ROOT,
    cycles,
    imported_names,
    module_graph,
    modules,
    names_at_run_time,
    package_graph,
)

DRAWING = {"moderngl", "vtk", "vtkmodules", "pyvista"}
FORBIDDEN = {
    "blobtree": {"decals", "decals.apps", "decals.shaders", *DRAWING},
    "decals": {"decals.apps"},
    "shaders": {"blobtree", "decals", "decals.apps", *DRAWING},
    "apps": {"tests"},
}
PYVISTA_FILES = (
    "colors.py", "field_grid.py", "field_slice.py", "graphics.py", "pyvista_views.py",
    "questions.py", "slicing.py", "vtk_errors.py",
)  # fmt: skip
"""The files of `blobtree` that use pyvista; a test checks that they import it late."""

EXTRAS = {
    "decals/scenes/figure.py": "experiments",
    "decals/scenes/parquet.py": "experiments",
    "decals/scenes/parquet_child.py": "experiments",
    "decals/scenes/tables.py": "experiments",
    "apps/commands/sandbox.py": "browser",
    "apps/commands/sweep.py": "experiments",
    "apps/commands/lessons.py": "browser",
    "apps/lab": "browser",
    "apps/lesson_pages": "browser",
    "apps/sandbox": "browser",
    "decals/experiments": "experiments",
}
"""Files and folders that need the packages of an extra, which a command imports late."""


@cache
def project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def files(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def imports(path: Path) -> list[str]:
    """Return the absolute imports of a file by their full names."""
    (name,) = (name for name, other in modules().items() if other == path)
    return imported_names(name, path)


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


@pytest.mark.parametrize("folder", FOLDERS)
def test_imports_run_one_way(folder: str) -> None:
    own = FOLDERS[folder]
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files(folder)
        if path.name != "__main__.py"  # a script, not a module that others import
        for name in imports(path)
        if any(
            within(name, package) and not (within(own, package) and within(name, own))
            for package in FORBIDDEN[folder]
        )
        and (path.name not in PYVISTA_FILES or name.split(".")[0] not in ("pyvista", "vtkmodules"))
    ]
    assert not wrong


def test_modules_import_each_other_one_way() -> None:
    """Imports at run time count, and those of the public names of packages."""
    assert [sorted(names) for names in cycles(module_graph())] == []


def test_the_core_imports_no_extras() -> None:
    assert core_to_extras() == []


def test_extras_are_modules_that_exist() -> None:
    listed = {
        f"{package}.{name}" if name != "*" else package
        for package, names in EXTRA_MODULES.items()
        for name in names.split()
    }
    assert listed <= set(modules())


def test_imports_at_run_time_are_followed(tmp_path: Path) -> None:
    path = tmp_path / "late.py"
    path.write_text(
        "from importlib import import_module\n"
        "from blobtree import tracing as rays\n"
        "def late(name): return import_module('blobtree.io'), import_module(f'{rays.__name__}.{name}')\n"
    )
    found = names_at_run_time("blobtree.late", path)
    assert {"blobtree.io", "blobtree.tracing.trace"} <= set(found)
    for name in ("blobtree.nodes.primitives.Point", "blobtree.io.load"):
        assert name in names_at_run_time("blobtree", modules()["blobtree"])


def test_packages_import_each_other_one_way() -> None:
    assert [sorted(names) for names in cycles(package_graph())] == []


def test_cycles_of_imports_are_found() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set(), "e": {"a"}}
    assert cycles(graph) == [{"b", "c"}]


@pytest.mark.parametrize("package", [name for name in FOLDERS if name in ("blobtree", "decals")])
def test_modules_name_the_module_that_they_import(package: str) -> None:
    """An import from the package's own public names would hide a cycle behind the lazy loader."""
    known = modules()
    wrong = [
        f"{name} imports {imported}"
        for name, path in known.items()
        if within(name, package) and not within(name, "decals.apps") and name != package
        for imported in imported_names(name, path)
        if imported.rpartition(".")[0] == package and imported not in known
    ]
    assert not wrong


def names_of(requirements: list[str]) -> set[str]:
    return {re.split(r"[\[>=<]", line)[0] for line in requirements}


def extra_packages(path: Path) -> set[str]:
    """Return the packages that a file may import late, because an extra installs them."""
    optional = project()["project"]["optional-dependencies"]
    own = path.relative_to(ROOT)
    return names_of(
        [line for part in (own, *own.parents) for line in optional.get(EXTRAS.get(part.as_posix()), ())]
    )


def test_every_imported_distribution_is_a_declared_dependency() -> None:
    declared = names_of(project()["project"]["dependencies"])
    providers = metadata.packages_distributions()
    for folder in FOLDERS:
        for path in files(folder):
            for name in imports(path):
                top = name.split(".")[0]
                if top in sys.stdlib_module_names or top in FOLDERS.values():
                    continue
                extra = extra_packages(path)
                known = (declared | extra) & set(providers.get(top, ())) or top.replace("_", "-") in extra
                assert known, f"{path.relative_to(ROOT)} imports {top}"


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_folder_of_code_is_packaged(folder: str) -> None:
    packages = project()["tool"]["setuptools"]["packages"]
    for path in files(folder):
        folders = path.parent.relative_to(ROOT / folder).parts
        assert ".".join([FOLDERS[folder], *folders]) in packages


def test_files_beside_the_code_of_apps_are_packaged() -> None:
    packaged: set[Path] = set()
    for package, patterns in project()["tool"]["setuptools"]["package-data"].items():
        if package.startswith("decals.apps"):
            folder = ROOT.joinpath(*package.split(".")[1:])
            packaged.update(path for pattern in patterns for path in folder.glob(pattern))
    kinds = ".css", ".html", ".js", ".json", ".jpg", ".md", ".mjs", ".png", ".svg", ".toml"
    files = [path for path in (ROOT / "apps").rglob("*") if path.suffix in kinds]
    assert len(files) > 50
    assert [path for path in files if path not in packaged] == []


def test_every_package_is_typed() -> None:
    assert all((ROOT / folder / "py.typed").is_file() for folder in FOLDERS)


def test_only_files_of_kernels_are_excused_from_types() -> None:
    excused = project()["tool"]["mypy"]["overrides"][0]["module"]
    assert excused == sorted(excused)
    tests = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in files("tests")}
    known = {**modules(), **tests}
    for name in excused:
        paths = [
            known[module]
            for module in known
            if re.fullmatch(name.replace(".", r"\.").replace("*", ".*"), module)
        ]
        assert paths, name
        sources = [path.read_text(encoding="utf-8") for path in paths]
        typed = [
            re.search(r"^\s*@(wp\.(func|kernel|struct)|of_row|formula)", text, re.MULTILINE)
            for text in sources
        ]
        assert any(typed), name


def test_files_that_begin_first_exist() -> None:
    assert [name for name in LONG_FILES if not (ROOT / "tests" / name).is_file()] == []


def test_the_version_stands_in_pyproject_alone() -> None:
    version = project()["project"]["version"]
    assert metadata.version("implicit-decals") == version
    places = [path for folder in FOLDERS for path in files(folder)]
    places += [ROOT / "CITATION.cff", *(ROOT / ".ci").glob("*.py")]
    texts = {path: path.read_text(encoding="utf-8") for path in places}
    named = [
        path
        for path, text in texts.items()
        if re.search(rf"(version[^\n]*|\")v?{re.escape(version)}\"", text)
    ]
    assert named == []


@pytest.mark.parametrize(
    ("tag", "changes", "words"),
    [
        ("v1.2.3", "## [1.2.3] - 2030-01-31\n", "in the changelog"),
        (
            "v1.2.4",
            "## [1.2.3] - 2030-01-31\n",
            "the tag is v1.2.4, but pyproject.toml has the version 1.2.3",
        ),
        ("1.2.3", "## [1.2.3] - 2030-01-31\n", "the tag is 1.2.3"),
        ("v1.2.3", "## [Unreleased]\n", "no section of 1.2.3 with its date"),
        ("v1.2.3", "## [1.2.3]\n", "no section of 1.2.3 with its date"),
    ],
)
def test_a_tag_is_the_version_and_in_the_changelog(
    tmp_path: Path, tag: str, changes: str, words: str
) -> None:
    (tmp_path / ".ci").mkdir()
    script = shutil.copy(ROOT / ".ci" / "check_version.py", tmp_path / ".ci")
    (tmp_path / "pyproject.toml").write_text('[project]\nversion = "1.2.3"\n')
    (tmp_path / "CHANGELOG.md").write_text(f"# Changelog\n\n{changes}")
    run = subprocess.run([sys.executable, script, tag], check=False, capture_output=True, text=True)
    assert words in run.stdout + run.stderr
    assert run.returncode == (words != "in the changelog")


def test_workflows_run_scripts_that_exist() -> None:
    workflows = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
    named = [
        name
        for path in workflows
        for name in re.findall(r"\.ci/[\w.]+\.py", path.read_text(encoding="utf-8"))
    ]
    assert {".ci/build_distributions.py", ".ci/check_version.py", ".ci/check_installed.py"} <= set(named)
    assert all((ROOT / name).is_file() for name in named)
