"""Fixtures for all tests."""

import gc
from collections.abc import Iterator

import pytest
from hypothesis import settings

import blobtree.kernels as kernels
from blobtree.custom.definition import CUSTOM_KINDS
from blobtree.declare.falloff import FALLOFF_NAMES  # that of the package loads the library
from blobtree.graphics import missing_gl_libraries

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
gc.disable()  # until all tests are collected: a fifth of the time would be spent on looking for garbage

LONG_FILES = (
    "docs/test_examples.py",
    "blobtree/tape/test_evaluate.py",
    "blobtree/nodes/test_profiles.py",
    "docs/test_pages.py",
    "decals/scattering/test_scatter.py",
    "decals/glsl/test_parity.py",
    "apps/lab/test_lab.py",
    "blobtree/test_kernels.py",
    "decals/window/test_window.py",
    "apps/sandbox/test_sandbox.py",
    "decals/window/test_waiting.py",
    "apps/commands/test_render.py",
    "decals/vtk/test_injection.py",
    "decals/window/test_unsaved.py",
    "decals/vtk/test_show.py",
    "blobtree/nodes/test_deformations.py",
    "decals/vtk/test_composition.py",
    "blobtree/test_fitting.py",
    "decals/field/test_parity.py",
    "decals/glsl/test_tapes.py",
    "blobtree/cells/test_sparse_cells.py",
    "blobtree/nodes/test_primitives.py",
    "decals/vtk/test_subplot.py",
    "apps/commands/test_define.py",
    "decals/scattering/test_deform.py",
    "blobtree/derivatives/test_curvature.py",
    "apps/commands/test_edit.py",
    "test_quiet_start.py",
    "test_processes.py",
    "blobtree/nodes/test_gradient_blends.py",
    "decals/baking/test_bake.py",
    "blobtree/test_conformance.py",
    "decals/field/test_mapping.py",
    "decals/scattering/test_invariants.py",
    "decals/window/test_host_plotter.py",
    "decals/editing/test_shape_keys.py",
    "decals/rendering/test_partial.py",
    "decals/editing/test_invalid_input.py",
    "decals/scattering/test_to_decals.py",
    "decals/vtk/test_lifetime.py",
    "decals/scattering/test_density.py",
    "decals/scattering/test_boundary.py",
    "decals/editing/test_primitive_commands.py",
    "blobtree/test_files.py",
    "decals/editing/test_commands.py",
    "blobtree/transpile/test_derivative.py",
    "apps/sandbox/test_display.py",
    "decals/vtk/test_component.py",
    "apps/test_gallery.py",
    "decals/scattering/test_relaxation.py",
    "decals/window/test_long_work.py",
    "blobtree/nodes/test_values.py",
    "decals/index/test_index.py",
    "blobtree/formulas/test_operators.py",
    "blobtree/transpile/test_specialize.py",
    "decals/scattering/test_shares.py",
    "decals/window/test_frames.py",
    "test_fuzz.py",
    "apps/sandbox/test_connections.py",
    "decals/editing/test_tree_commands.py",
    "decals/images/test_images.py",
    "blobtree/nodes/test_attributes.py",
    "decals/test_inputs.py",
    "decals/rendering/test_filter.py",
    "blobtree/meshing/test_reuse.py",
    "decals/surfaces/test_vtk_process.py",
    "decals/vtk/test_hiding.py",
    "decals/editing/test_fuzz.py",
    "blobtree/meshing/test_adaptive.py",
    "decals/rendering/test_edited.py",
    "decals/field/test_contact.py",
    "decals/scattering/test_invalid_input.py",
    "decals/window/test_on_screen.py",
    "blobtree/custom/test_definitions.py",
    "apps/sandbox/test_files.py",
    "decals/field/test_law.py",
    "decals/vtk/test_lights.py",
    "decals/field/test_evaluate.py",
    "decals/window/test_ticking.py",
    "decals/rendering/test_decals.py",
    "decals/index/test_editor.py",
    "decals/rendering/test_scene.py",
    "decals/rendering/test_materials.py",
    "decals/rendering/test_offset.py",
    "decals/rendering/test_walk_cache.py",
)
"""Files of several seconds begin first, so that no worker ends long before another."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the slow cases, and put the files that take longest in front."""
    cases = [item for item in items if isinstance(item, pytest.Function) and hasattr(item, "callspec")]
    for item in cases:
        if is_slow_case(item):
            item.add_marker(pytest.mark.slow)
    if not any("::" in argument for argument in config.args):
        check_named_cases(cases)
    if wrong := [item.nodeid for item in cases if " at 0x" in item.callspec.id]:
        raise pytest.UsageError(f"names of cases hold addresses, which differ between workers: {wrong}")
    order = {f"tests/{name}": place for place, name in enumerate(LONG_FILES)}
    items.sort(key=lambda item: order.get(item.nodeid.partition("::")[0], len(order)))


def is_slow_case(item: pytest.Function) -> bool:
    """Return True if a mark of the test makes this case slow."""
    slow = {name for mark in item.iter_markers("slow_cases") for name in mark.args}
    ordinary = {name for mark in item.iter_markers("ordinary_cases") for name in mark.args}
    return item.callspec.id in slow or (bool(ordinary) and item.callspec.id not in ordinary)


def check_named_cases(items: list[pytest.Function]) -> None:
    """Raise UsageError if one of these marks names a case that its test does not have."""
    found: dict[str, set[str]] = {}
    named: dict[str, set[str]] = {}
    for item in items:
        test = item.nodeid.partition("[")[0]
        found.setdefault(test, set()).add(item.callspec.id)
        marks = (*item.iter_markers("slow_cases"), *item.iter_markers("ordinary_cases"))
        named.setdefault(test, set()).update(name for mark in marks for name in mark.args)
    if wrong := [
        f"{test}: {sorted(named[test] - found[test])}" for test in named if named[test] - found[test]
    ]:
        raise pytest.UsageError(f"marks name cases that there are not: {wrong}")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config) -> None:
    """Keep this order among workers: by default xdist 3.8 sorts files by their numbers of tests."""
    config.option.loadscopereorder = False


def pytest_collection_finish() -> None:
    """Each worker collects all tests, so modules of tests must not compute when they are imported."""
    if kernels._state.loaded:
        names = ", ".join(sorted(name for name, _ in kernels._state.loaded))
        raise pytest.UsageError(f"the import of a module of tests has launched kernels of {names}")
    gc.enable()
    gc.freeze()  # Python then looks for garbage among what tests make, not among all tests


@pytest.fixture(autouse=True)
def own_kinds() -> Iterator[None]:
    """Give each test its own registries: pages and examples define kinds under names of other tests."""
    kinds, falloffs = dict(CUSTOM_KINDS), dict(FALLOFF_NAMES)
    yield
    CUSTOM_KINDS.clear()
    CUSTOM_KINDS.update(kinds)
    FALLOFF_NAMES.update(falloffs)


@pytest.fixture(scope="session")
def vtk_display() -> None:
    """Let VTK draw once: its first window would end the standalone OpenGL contexts made before."""
    if missing_gl_libraries():
        return
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=[16, 16])
    plotter.show(auto_close=True)
