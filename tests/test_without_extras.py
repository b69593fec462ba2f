"""The core alone: its own tests pass in a copy of the product without the files of the extras."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.core_and_extras import is_extra
from tests.import_graph import ROOT, modules

CORE_TESTS = """
    blobtree/cells/test_scan.py blobtree/formulas/test_falloff.py blobtree/nodes/test_invalid_nodes.py
    blobtree/nodes/test_paths.py decals/field/test_ownership.py decals/index/test_change_log.py
    decals/test_model.py decals/test_sorting.py
    """
"""Tests of the core that use no extra, in the folder of tests."""

ENTRIES = """
    decals.rendering.renderer decals.scattering.scatter decals.scenes.files blobtree.io decals.vtk.component
    """
"""Modules through which the core is entered."""


@pytest.mark.slow
def test_the_core_passes_its_tests_without_the_extras(tmp_path: Path) -> None:
    ignored = shutil.ignore_patterns("__pycache__", "golden")
    for source, copy in (("blobtree",) * 2, ("decals",) * 2, ("shaders", "decals/shaders"), ("tests",) * 2):
        shutil.copytree(ROOT / source, tmp_path / copy, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    removed = [path for name, path in modules().items() if is_extra(name)]
    for path in removed:
        (tmp_path / path.relative_to(ROOT)).unlink()
    assert len(removed) > 150
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "PYTHONSAFEPATH": "1"}
    imports = "; ".join(f"import {name}" for name in ENTRIES.split())
    tests = [f"tests/{name}" for name in CORE_TESTS.split()]
    marks = ["-m", "not slow and not gpu"]
    for command in (["-c", imports], ["-m", "pytest", "-q", "-p", "no:cacheprovider", *marks, *tests]):
        ran = subprocess.run(
            [sys.executable, *command], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert ran.returncode == 0, ran.stdout[-3000:] + ran.stderr[-3000:]
