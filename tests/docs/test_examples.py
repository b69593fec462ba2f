"""Every public name has an example in its docstring, and every example runs."""

import doctest
import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import decals
from blobtree import Node
from blobtree.errors import ImplicitDecalsError
from blobtree.nodes.model import Model
from blobtree.nodes.questions import Questions
from blobtree.tape.model import ImplicitModel
from decals import Scene
from tests.decals.baking.glb import need

PACKAGES = (
    "blobtree",
    "decals",
    "decals.editing",
    "decals.hosts",
    "decals.images",
    "decals.index",
    "decals.rendering",
    "decals.scattering",
    "decals.surfaces",
    "decals.vtk",
    "decals.window",
)
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def public_objects() -> Iterator[tuple[str, Any]]:
    """Yield each public class and function once, errors excepted."""
    seen: set[int] = set()
    for package in PACKAGES:
        module = import_module(package)
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if not (inspect.isclass(value) or inspect.isfunction(value)) or id(value) in seen:
                continue
            if inspect.isclass(value) and issubclass(value, ImplicitDecalsError):
                continue
            seen.add(id(value))
            yield f"{package}.{name}", value


OBJECTS = dict(public_objects())

BASES = {
    "blobtree.tape.model.ImplicitModel": ImplicitModel,
    "blobtree.nodes.model.Model": Model,
    "blobtree.nodes.questions.Questions": Questions,
}
EXAMPLES = OBJECTS | BASES
"""Objects whose examples run: the public ones, and bases from which public classes have methods."""


@pytest.mark.parametrize("name", OBJECTS)
def test_a_public_name_has_an_example(name: str) -> None:
    text = inspect.getdoc(OBJECTS[name]) or ""
    assert "Examples\n--------" in text, f"{name} has no Examples section"
    assert ">>>" in text


@pytest.fixture
def shared_covers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let equal calls of `decals.cover` in several examples scatter decals once."""

    def cover(*models: Any, **options: Any) -> Scene:
        if not all(isinstance(model, Node) for model in models):
            return scattered(*models, **options)
        call = repr((models, options))
        if call not in COVERED:
            COVERED[call] = scattered(*models, **options)
        return COVERED[call]

    scattered = decals.cover
    monkeypatch.setattr(decals, "cover", cover)


COVERED: dict[str, Scene] = {}
"""Scenes of examples by the arguments of `decals.cover`."""


@pytest.mark.usefixtures("shared_covers")
@pytest.mark.slow_cases(
    "blobtree.Arc",
    "blobtree.ContactSurface",
    "blobtree.Fit",
    "blobtree.SolidContact",
    "decals.Scene",
    "decals.define_contact",
    "decals.editing.ReplaceScene",
    "decals.editing.ScatterDecals",
)
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "decals.bake":
        need("trimesh", "xatlas")
    monkeypatch.chdir(tmp_path)
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    report: list[str] = []
    for example in doctest.DocTestFinder().find(EXAMPLES[name], name, globs={}):
        runner.run(example, out=report.append)
    assert not runner.failures, "".join(report)
