"""The public names of the package: a list that changes only on purpose."""

from dataclasses import fields, is_dataclass
from importlib import import_module

import pytest

import decals
from decals.editing import GroupOperands, RemovePrimitive
from decals.options import described
from tests.programs import output_of

PACKAGES = [
    "editing", "errors", "experiments", "field", "hosts", "images", "index", "pages", "rendering",
    "scattering", "scenes", "surfaces", "vtk", "window",
]  # fmt: skip
NAMES = [
    "Camera", "Contact", "ContactLaw", "DecalImage", "DecalMaterial", "Decals", "ImageMapping",
    "ImplicitDecalsError",
    "Interaction", "MeshObject", "NO_IMAGE", "Relaxation", "Scene", "Sizing", "TreeObject", "__version__",
    "animate", "bake", "content_hash", "cover", "define_contact", "displace", "edit", "evaluate",
    "evaluate_batch", "export", "from_table", "load_table", "save_table", "to_arrow", "to_pandas",
    "load_image", "load_model",
    "load_scene", "measure", "pose", "render", "render_batch",
    "reproduce", "save_html", "save_scene", "scatter", "shader",
    "show", "skin", "turntable",
    "AreaGradient", "LineKind", "SurfaceLine", "area_gradient", "outlines", "save_figure",
]  # fmt: skip
OF_PACKAGES = {
    "field": ["BatchSamples", "MaterialSamples", "Neighbors", "Samples", "Walks"],
    "experiments": [
        "Design", "Grid", "LatinHypercube", "Results", "Seeds", "Sobol", "report", "run",
    ],
    "hosts": ["Changes", "Shader", "ShaderTexture", "Upload"],
    "index": ["DecalBatch", "DecalEditor", "DecalIndex"],
    "pages": ["Page", "page", "viewer_script"],
    "rendering": [
        "Background", "Buffers", "Context", "Drawable", "Drawing", "Environment", "Light", "Lighting",
        "Picture", "Projection", "RenderOptions", "Renderer", "STUDIO", "SceneLike", "Size", "TRANSPARENT",
        "Viewpoint", "register",
    ],
    "scattering": [
        "Creases", "Cylindrical", "ImageChoice", "Jitter", "Orientation", "PaintedImage", "Planar",
        "Spherical", "TextureCoordinates", "Zone", "Zones", "gradient_of", "on_copies", "region_mask",
        "remeshed_points", "seen_from_outside", "vertex_density",
    ],
    "surfaces": [
        "BaseColor", "BaseTexture", "ImplicitSurface", "MeshCheck", "MeshSurface", "Model", "Surface", "Wrap",
        "as_surface", "check_mesh", "linear_colors", "read_mesh",
    ],
}  # fmt: skip


def test_the_names_of_decals() -> None:
    assert decals.__all__ == sorted([*NAMES, *PACKAGES])
    assert dir(decals) == decals.__all__


@pytest.mark.parametrize("package", OF_PACKAGES)
def test_the_names_of_a_package(package: str) -> None:
    assert getattr(decals, package).__all__ == OF_PACKAGES[package]


@pytest.mark.parametrize("package", ["", *PACKAGES])
def test_every_name_can_be_loaded(package: str) -> None:
    module = import_module(f"decals.{package}".rstrip("."))
    for name in getattr(module, "__all__", []):
        assert getattr(module, name) is not None, name


def test_unknown_names_are_attribute_errors() -> None:
    with pytest.raises(AttributeError, match="nothing"):
        decals.nothing  # type: ignore[attr-defined]  # noqa: B018


def test_public_functions_are_no_packages() -> None:
    for name in NAMES:
        assert type(getattr(decals, name)).__name__ != "module", name


@pytest.mark.parametrize(
    ("statement", "heavy"),
    [
        ("import decals.errors", {"warp", "pyvista", "moderngl", "vtk"}),
        ("from decals import cover", {"blobtree.io", "blobtree.foreign.reading", "decals.scenes.files"}),
    ],
)
def test_imports_load_nothing_heavy(statement: str, heavy: set[str]) -> None:
    """Readers of files load all kinds of nodes: half a second."""
    assert output_of(f"import sys; {statement}; print(sorted({heavy} & sys.modules.keys()))").strip() == "[]"


def test_docstrings_of_commands_describe_all_parameters() -> None:
    """Those of a base class too; a class may describe them in other words."""
    editing = import_module("decals.editing")
    commands = [
        value for value in (getattr(editing, name) for name in editing.__all__) if hasattr(value, "compute")
    ]
    kinds = [kind for kind in commands if isinstance(kind, type) and is_dataclass(kind)]
    assert len(kinds) > 30
    for kind in kinds:
        undescribed = {item.name for item in fields(kind) if item.init} - set(described(kind))
        assert not undescribed, kind
    assert (RemovePrimitive.__doc__ or "").count("Parameters\n----------\nobject\n    Index") == 1
    assert described(GroupOperands)["path"].startswith("Path of a sum")
