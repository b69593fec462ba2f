"""The shaders of pages are valid in WebGL's language: those of trees of all kinds, and of all lights."""

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import decals
from blobtree import GradientBlend, Node, Point
from decals.pages.programs import PREFIX, VERSION, mesh_program, picture_programs, tree_program
from decals.rendering import Drawing, Environment, Lighting
from decals.rendering.tracing_shader import Kinds
from tests.blobtree.trees import random_trees

BALL = Point((0, 0, 0), radius=1)
ENVIRONMENT = Environment(np.ones((8, 16, 3), np.float32), visible=True)


def check(folder: Path, programs: Sequence[Sequence[str]]) -> None:
    """Make sure that glslang links vertex and fragment shaders."""
    if shutil.which("glslangValidator") is None:
        pytest.skip("glslangValidator is not installed (on Debian: apt-get install glslang-tools)")
    for number, program in enumerate(programs):
        paths = [folder / f"{number}.{stage}" for stage in ("vert", "frag")]
        for path, text in zip(paths, program, strict=True):
            path.write_text(text, encoding="utf-8")
        ended = subprocess.run(
            ["glslangValidator", "-l", *paths], capture_output=True, text=True, check=False
        )
        assert ended.returncode == 0, ended.stdout[-3000:]


def tree_programs(trees: Sequence[Node]) -> list[list[str]]:
    """Return the programs of trees."""
    return [tree_program(Kinds.of(tree.tape)) for tree in trees]


def test_meshes_and_plain_trees(tmp_path: Path) -> None:
    check(tmp_path, [mesh_program(textured=flag) for flag in (False, True)])
    check(tmp_path, tree_programs([BALL]))


@pytest.mark.slow
def test_trees_of_all_kinds(tmp_path: Path) -> None:
    other = BALL.translate((1, 0, 0)).twist(20)
    blend = GradientBlend(BALL, other, start_angle=15, full_angle=75)
    check(tmp_path, tree_programs([blend, *random_trees(3, 40)]))


@pytest.mark.parametrize(
    "drawing",
    [Drawing(), Drawing(lights=Lighting(())), Drawing(environment=ENVIRONMENT)],
    ids=["studio", "lights", "environment"],
)
@pytest.mark.parametrize("materials", [False, True], ids=["plain", "materials"])
@pytest.mark.slow_cases("plain-lights", "plain-environment", "materials-studio", "materials-lights")
def test_pictures_in_all_lights(drawing: Drawing, materials: bool, tmp_path: Path) -> None:
    code = decals.shader(decals.cover(BALL, count=3), version=VERSION, prefix=PREFIX)
    form = replace(code.form, materials=materials)
    texts = picture_programs(replace(code, form=form), drawing)
    mode = texts["modes"]["elastic"]
    ends = texts["ends"].values()
    check(tmp_path, [[texts["screen"], begin + end] for begin in mode.values() for end in ends])
