"""The Python of every page runs as printed, and what the pages promise of it is true."""

import json
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from cyclopts import CycloptsError
from PIL import Image

from blobtree import Point, load, polygonize
from blobtree.graphics import install_advice, missing_gl_libraries
from blobtree.transpile.builtins import BUILTINS
from decals import load_scene
from decals.apps.cli import app
from decals.experiments import Results
from decals.rendering import Drawing, RenderOptions
from tests.decals.baking.glb import need
from tests.docs import published

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
DRAWS = re.compile(r"\brender\b|\bRenderer\b|\bPlotter\b|\bshow\(|\bedit\(")

Session = dict[str, Any]


def code(page: Path) -> str:
    """Python blocks of a page, as the one script that they make."""
    return "\n\n".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL))


def check_readme(session: Session) -> None:
    assert len(load_scene("scene.json").decals) == len(session["scene"].decals)
    colors = Image.open("duck.png").getcolors(1 << 20)
    assert colors is not None
    assert len(colors) > 1000


def check_tour(session: Session) -> None:
    assert len(session["scene"].decals) == 400
    assert len(session["both"].decals) == 500
    assert not np.array_equal(np.asarray(Image.open("duck.png")), np.asarray(Image.open("smaller.png")))


def check_modelling(session: Session) -> None:
    assert len(session["mesh"].faces) > 1000
    assert session["surface"].n_points > 1000
    assert session["low"][0] < session["high"][0]


def check_character(session: Session) -> None:
    edges = np.sort(session["mesh"].faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    assert load("newt.json") == session["walking"] != session["resting"]


def check_custom_nodes(session: Session) -> None:
    assert len(session["mesh"].faces) > 1000
    assert session["model"].support[1][0] > 1.2
    page = (DOCS / "custom-nodes.md").read_text(encoding="utf-8")
    (promise,) = re.findall(r"print\(error\)  # ([\w.]+):(\d+): halfway: ", page)
    assert f"{promise[0]}:{promise[1]}: halfway: " in session["printed"]


def check_published_nodes(session: Session) -> None:
    published.check_all(session)
    nodes = (DOCS / "published-nodes.md").read_text(encoding="utf-8").split("\n## ")[1:]
    assert len(nodes) == 12
    for node in nodes:
        (block,) = re.findall(r"```python\n(.*?)```", node, flags=re.DOTALL)
        (picture,) = re.findall(r"\]\((images/published/\w+\.jpg)\)", node)
        assert len(block.splitlines()) <= 40
        assert (DOCS / picture).stat().st_size <= 40_000


def test_the_page_of_custom_nodes_lists_the_whole_language() -> None:
    page = (DOCS / "custom-nodes.md").read_text(encoding="utf-8")
    section = page.split("## Language of typed functions")[1].split("\n## ")[0]
    listed = set(re.findall(r"`wp\.(\w+)`", section))
    types = {
        "float32",
        "int32",
        "uint32",
        "bool",
        *(f"vec{n}{kind}" for n in (2, 3, 4) for kind in ("", "i")),
    }
    assert listed == set(BUILTINS) | types


def check_meshing(session: Session) -> None:
    assert len(session["mesh"].faces) > 1000
    assert set(np.unique(session["sharp"].sheet_counts)) <= {0, 1, 2, 3}
    assert len(session["shown"].vertices) > len(session["sharp"].vertices)
    assert len(session["edited"].faces) > 1000
    assert session["surface"].n_points > 1000
    assert list(session["field"].keys()) == ["plane", "lines", "surface"]
    assert len(session["close"].faces) > 1000


def check_decals(session: Session) -> None:
    assert session["samples"].owner[0] in (0, 1, 2)
    assert len(session["first_two"]) == 2
    assert len(session["all_of_them"]) == 6
    pictures = [np.asarray(Image.open(f"{name}.png")) for name in ("rings", "radial", "layered", "chord")]
    assert not np.array_equal(pictures[0], pictures[1])


def check_baking(session: Session) -> None:
    for name in ("ball.glb", "ball-colors.glb"):
        assert Path(name).read_bytes()[:4] == b"glTF"
    assert len(session["scene"].decals) == 100


def check_rendering(session: Session) -> None:
    assert session["picture"].shape == (480, 640, 4)
    assert (session["buffers"].owner >= 0).any()


def check_shader(session: Session) -> None:
    """The picture of plain moderngl is that of `render` without light; an edit uploads few bytes."""
    from tests.decals.hosts.agreement import equal_pixels

    scene = session["scene"]
    gray = replace(scene.objects[0], color=(0.7354, 0.7354, 0.7354))
    shown = np.asarray(Image.open("ring.png"))
    assert equal_pixels(shown, scene.replace(objects=[gray])) >= 0.995
    assert sum(upload.array.nbytes for upload in session["changes"].uploads) < 4000
    assert "decal_records" in session["printed"]


def check_pages(_session: Session) -> None:
    assert Path("scales.html").read_text(encoding="utf-8").startswith("<!doctype html>")


def check_scattering(session: Session) -> None:
    assert len(session["spots"]) == 300
    assert (session["spots"].positions[:, 1] > -0.5).all()
    assert session["relaxation"].count == 500
    assert "rho=" in session["printed"]


def check_inputs(session: Session) -> None:
    assert float(session["middle"]) > 1.0
    saved = load_scene("blob.json").images
    assert [image.source for image in saved] == ["image 0", "image 1", "eye"]
    for image, again in zip(session["scene"].images, saved, strict=True):
        np.testing.assert_array_equal(image.pixels, again.pixels)


def check_editing(session: Session) -> None:
    assert Path("scene.json").exists()
    assert len(session["session"].labels) == 4
    assert len(session["edited"].decals) == 100
    assert len(session["selected"]) == 1


def check_pyvista(session: Session) -> None:
    assert session["pick"].object_id == 0
    assert session["pick"].owner >= 0
    for name in ("among", "stock", "two", "lights"):
        drawn = np.asarray(Image.open(f"{name}.png").convert("RGB")).astype(int)
        path = DOCS / "images" / "pyvista" / f"{name}.png"
        stored = np.asarray(Image.open(path).convert("RGB")).astype(int)
        assert drawn.shape == stored.shape
        assert np.abs(drawn - stored).mean() < 6
    red, without = (np.asarray(Image.open(f"{name}.png")).astype(int) for name in ("red", "without"))
    assert np.median(red[..., 0] - red[..., 1]) >= 0
    assert (red[..., 0] - red[..., 2]).max() > 40
    assert (red != without).any()


def check_many_runs(_session: Session) -> None:
    """Run the page as a script of its own, as its children import it by its name."""
    run = subprocess.run(
        [sys.executable, "script.py"], check=True, timeout=240, capture_output=True, text=True
    )
    counts = json.loads(run.stdout.splitlines()[0])
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] > 10


def check_experiments(_session: Session) -> None:
    """Run a part of the sweep of the page as a script of its own, as its workers import it by its name."""
    script = Path("script.py").read_text(encoding="utf-8")
    part = "    assert len(design) == 255\n"
    part += "    design = design.where(lambda steps, seed: steps + 20 * seed < 40)\n"
    assert "    report(run(" in script
    Path("script.py").write_text(
        script.replace("    report(run(", part + "    report(run("), encoding="utf-8"
    )
    subprocess.run([sys.executable, "script.py"], check=True, timeout=240)
    results = Results("results")
    assert len(results) == 4
    assert results.failed == []
    means = [group["mean"] for group in results.interval("result", by=["steps"])]
    assert 0.8 < means[0] < means[-1] < 0.95
    assert "<svg" in Path("evenness.svg").read_text(encoding="utf-8")


def test_the_sweep_of_the_page_has_at_most_twelve_lines() -> None:
    lines = [line for line in code(DOCS / "experiments.md").splitlines() if line.strip()]
    assert len(lines) <= 12


CHECKS: dict[str, Callable[[Session], None]] = {
    "README": check_readme,
    "tour": check_tour,
    "modelling": check_modelling,
    "character": check_character,
    "custom-nodes": check_custom_nodes,
    "published-nodes": check_published_nodes,
    "meshing": check_meshing,
    "decals": check_decals,
    "rendering": check_rendering,
    "baking": check_baking,
    "shader": check_shader,
    "pages": check_pages,
    "scattering": check_scattering,
    "inputs": check_inputs,
    "editing": check_editing,
    "pyvista": check_pyvista,
    "experiments": check_experiments,
    "many-runs": check_many_runs,
}
"""Checks of what is left after a page's code has run, by the page's name."""


@pytest.fixture
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures and windows of no other size and samples are small and coarse."""
    monkeypatch.setattr(RenderOptions.__init__, "__defaults__", ((240, 180),))
    coarse = {field.name: field.default for field in fields(Drawing)} | {"samples": 1}
    monkeypatch.setattr(pv.global_theme, "window_size", [240, 180])
    for kind in (Drawing, RenderOptions):
        monkeypatch.setattr(kind.__init__, "__kwdefaults__", coarse)
    assert RenderOptions() == RenderOptions(size=(240, 180), samples=1)


@pytest.mark.usefixtures("small_pictures")
@pytest.mark.slow_cases(
    "figures",
    "measures",
    "baking",
    "character",
    "contact",
    "custom-nodes",
    "experiments",
    "decals",
    "many-runs",
    "modelling",
    "published-nodes",
    "pyvista",
    "rendering",
    "scattering",
    "tour",
)
@pytest.mark.parametrize("page", [page for page in PAGES if code(page)], ids=lambda page: page.stem)
def test_the_python_of_a_page_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As one script, in an empty folder, without windows."""
    script = code(page)
    if DRAWS.search(script) and (missing := missing_gl_libraries()):
        pytest.skip(f"no OpenGL here: {install_advice(missing)}")
    if "decals.bake(" in script:
        need("trimesh", "xatlas")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pv, "OFF_SCREEN", True)
    Path("script.py").write_text(script, encoding="utf-8")
    session = runpy.run_path("script.py", run_name="script")
    session["printed"] = capsys.readouterr().out
    if page.stem in CHECKS:
        CHECKS[page.stem](session)


def test_every_check_has_a_page_with_code() -> None:
    assert set(CHECKS) <= {page.stem for page in PAGES if code(page)}


def test_links_between_pages_lead_to_files() -> None:
    """Relative links and pictures of every page, also of pages for contributors."""
    broken = []
    for page in [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]:
        targets = re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8"))
        files = [target for target in targets if "://" not in target]
        broken += [f"{page.name}: {file}" for file in files if not (page.parent / file).exists()]
    assert broken == []


def test_commands_on_pages_name_existing_files() -> None:
    missing = []
    for page in [*PAGES, ROOT / "CONTRIBUTING.md"]:
        text = page.read_text(encoding="utf-8")
        modules = set(re.findall(r"python -m ((?:tests|decals)\.[\w.]*\w)", text)) - {"tests.bench.NAME"}
        missing += [f"{page.name}: {module}" for module in modules if find_spec(module) is None]
        files = re.findall(r"python (\w+/[\w/]+\.py)", text)  # a reader's own script has no folder
        missing += [f"{page.name}: {file}" for file in files if not (ROOT / file).exists()]
    assert missing == []


def test_every_command_on_the_pages_is_valid() -> None:
    wrong, count = [], 0
    for page in [*PAGES, ROOT / "CONTRIBUTING.md"]:
        for line in re.findall(r"^implicit-decals (.+)", page.read_text(encoding="utf-8"), re.MULTILINE):
            count += 1
            try:
                app.parse_args(shlex.split(line, comments=True), print_error=False, exit_on_error=False)
            except CycloptsError as error:
                wrong.append(f"{page.name}: {line}: {error}")
    assert wrong == []
    assert count > 20


def test_the_readme_activates_the_environment_before_its_first_command() -> None:
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    lines = [line.partition("#")[0].strip() for line in "".join(blocks).splitlines()]
    assert lines[:3] == ["make demo", ". .venv/bin/activate", "implicit-decals doctor"]


def test_the_key_table_is_that_of_the_editor() -> None:
    """To correct the page, copy the result of `help_table` between its two marks."""
    from decals.editing import KEYS

    page = (DOCS / "editing.md").read_text(encoding="utf-8")
    assert f"<!-- keys -->\n{KEYS.help_table()}<!-- /keys -->" in page


def test_creases_save_as_many_triangles_as_the_page_says() -> None:
    tree = Point((0, 0, 0), radius=1.0) - Point((0.8, 0.13, 0.07), radius=0.9)
    plain, sharp = (len(polygonize(tree, chord_error=0.01, creases=c).faces) for c in (False, True))
    text = (DOCS / "meshing.md").read_text(encoding="utf-8").replace(",", "")
    assert all(f"{count} " in text for count in (plain, sharp)), (plain, sharp)
