"""Contexts: what they cannot do they say; they nest; programs are compiled once."""

import gc
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

from decals import Decals
from decals.errors import NoGraphics
from decals.rendering import Context, Lighting, Renderer, RenderOptions
from decals.rendering.pixel_pass import BACKEND_VARIABLE
from decals.rendering.targets import WHOLE_SLOT
from decals.shaders import CompileError, Source, compose
from decals.surfaces.normals import vertex_normals
from tests.decals.rendering.pictures import view_of
from tests.decals.shapes import torus
from tests.programs import output_of


def usable(context: Context) -> bool:
    try:
        context.gl.texture((2, 2), 4).release()
    except moderngl.Error:
        return False
    return True


def test_no_context_is_a_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_: object) -> None:
        raise Exception("eglInitialize failed (0x3001)")  # noqa: TRY002

    monkeypatch.setattr(moderngl, "create_context", fail)
    with pytest.raises(NoGraphics, match=r"no OpenGL 3.3 context .*0x3001.*doctor"):
        Context.standalone()


def test_the_newest_context_that_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some drivers give no more than what is asked for, others fail where they have less."""
    real, asked = moderngl.create_context, []

    def old(*, require: int, **settings: Any) -> moderngl.Context:
        asked.append(require)
        if require > 410:
            raise Exception("requested OpenGL version is not supported")  # noqa: TRY002
        return real(require=require, **settings)

    monkeypatch.setattr(moderngl, "create_context", old)
    with Context.standalone() as context, context.current():
        assert usable(context)
    assert asked == [430, 330]


def test_missing_libraries_are_asked_for_first(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise NoGraphics("apt-get install libegl1")

    monkeypatch.setattr("decals.rendering.context.require_gl", missing)
    monkeypatch.setattr(moderngl, "create_context", lambda **_: pytest.fail("must not be reached"))
    with pytest.raises(NoGraphics, match="libegl1"):
        Context.standalone()


def test_blocks_nest_and_give_back(context: Context) -> None:
    with context.current(), Context.standalone() as other:
        assert usable(context)
        with other.current():
            with context.current():
                assert usable(context)
            assert usable(other)
        assert usable(context)


def test_a_program_is_compiled_once(context: Context) -> None:
    sources = (
        compose("screen.vert"),
        Source.named("a", "#version 330 core\nout vec4 c; void main() { c = vec4(1); }"),
    )
    assert context.program(*sources) is context.program(*sources)


def test_programs_that_were_not_wanted_for_long_are_released(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(context._programs, "_max_size", 2000)

    def program(number: int) -> moderngl.Program:
        text = f"#version 330 core\nout vec4 c; void main() {{ c = vec4({number}.0); }}"
        vertex = compose("screen.vert")
        return context.program(vertex, Source.named("a", f"{text:{900 - len(vertex.text)}}"))

    with context.current():
        frame = context.gl.simple_framebuffer((2, 2), dtype="f4")
        frame.use()
        _ = (
            context.gl.error
        )  # moderngl binds the framebuffer before again, which an earlier test has released
        used = program(0)
        for number in (1, 2, 3):
            program(number)
        assert len(context._programs._kept) == 2
        assert used.mglo not in context._unused  # still held here
        assert program(0) is used
        program(2), program(3)
        context.gl.vertex_array(used, []).render(vertices=3)
        assert context.gl.error == "GL_NO_ERROR"
        held = used.mglo
        del used
        assert held in context._unused
        context.release_unused()
        assert held not in context._unused
        assert program(0) is program(0)


def test_a_bad_shader_names_its_file_and_line(context: Context, tmp_path: Path) -> None:
    (tmp_path / "a.frag").write_text("//@ slot ink\nout vec4 c;\nvoid main() { c = ink(); }\n")
    ink = Source.named("ink.glsl", "vec4 ink() {\n    return vec4(missing, 1.0);\n}")
    fragment = compose("a.frag", slots={"ink": ink}, directory=tmp_path)
    with pytest.raises(CompileError, match=r"ink.glsl:2: .*missing"):
        context.program(compose("screen.vert"), fragment)


def test_an_attached_context_is_left_alone(context: Context) -> None:
    attached = Context(context.gl)
    with attached.current():
        assert usable(attached)
    attached.release()
    assert usable(context)


@pytest.fixture
def no_idle(vtk_display: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """No context is idle at the beginning, and none that the test leaves is used after it."""
    monkeypatch.setattr("decals.rendering.context._idle", [])


def drawn(renderer: Renderer) -> np.ndarray:
    shape = torus(rows=12, columns=6)
    return renderer.render(view_of(Decals.empty(), shape), RenderOptions(size=(16, 12), samples=1))


@pytest.mark.usefixtures("no_idle")
def test_a_renderer_takes_over_the_context_of_the_one_before() -> None:
    """With its programs, on any thread, and after a second release by the first one."""
    with Renderer() as first:
        picture, programs = drawn(first), first.context._programs.values()
    first.release()
    with ThreadPoolExecutor(1) as thread:
        second = thread.submit(Renderer).result()
        assert second.context is first.context
        first.release()
        np.testing.assert_array_equal(thread.submit(drawn, second).result(), picture)
        assert second.context._programs.values() == programs
        thread.submit(second.release).result()


@pytest.mark.usefixtures("no_idle")
def test_programs_of_former_options_are_released_unless_the_context_keeps_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In a context of its own, since renderers of other tests may use the same programs."""
    shape = torus(rows=12, columns=6)
    normals = vertex_normals(shape.vertices, shape.faces)[::9]
    tangents = np.cross(normals, (0.1, 0.2, 1.0))
    view = view_of(Decals(shape.vertices[::9], normals, tangents, 0.3), shape)
    with Renderer() as renderer:
        monkeypatch.setattr(renderer.context._programs, "_max_size", 1)

        def drawn_by(**drawing: Any) -> np.ndarray:
            return renderer.render(view, RenderOptions(size=(16, 12), samples=1, **drawing))

        first = drawn_by(contact="product")
        decal_pass, light_pass = (
            weakref.ref(getattr(renderer._targets.get(WHOLE_SLOT), name)._last[1].program)
            for name in ("decal_pass", "light_pass")
        )
        drawn_by(contact="elastic", lights=Lighting(()))
        gc.collect()
        assert decal_pass() is None
        assert light_pass() is None
        np.testing.assert_array_equal(drawn_by(contact="product"), first)


@pytest.mark.usefixtures("no_idle")
def test_renderers_at_the_same_time_have_contexts_of_their_own() -> None:
    with Renderer() as first, Renderer() as second:
        assert first.context is not second.context
    with Renderer() as third, Renderer() as fourth:
        assert third.context is second.context
        assert fourth.context not in (first.context, second.context)
        np.testing.assert_array_equal(drawn(third), drawn(fourth))


@pytest.mark.usefixtures("no_idle")
def test_a_context_is_not_used_again_if_vtk_was_imported_after_it_was_made() -> None:
    with Renderer() as first:
        pass
    first.context._display_held = not first.context._display_held
    with Renderer() as second:
        assert second.context is not first.context


@pytest.mark.usefixtures("no_idle")
def test_a_reset_of_the_graphics_driver_is_an_error_and_its_context_is_not_used_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """moderngl has no name for GL_CONTEXT_LOST. No driver is reset here: the test sets the error."""
    with Renderer() as first, monkeypatch.context() as reset:
        reset.setattr(moderngl.Context, "error", "GL_UNKNOWN_ERROR")
        with pytest.raises(NoGraphics, match="driver was reset while a picture was drawn; draw it again"):
            drawn(first)
    with Renderer() as second:
        assert second.context is not first.context
        assert drawn(second).any()


@pytest.mark.usefixtures("no_idle")
def test_the_environment_names_the_backend_of_a_context_that_is_used_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("fragment", "compute"):
        monkeypatch.setenv(BACKEND_VARIABLE, name)
        with Renderer() as renderer:
            assert renderer.backend == name


LOST = """
import ctypes

from decals.rendering import Renderer

egl = ctypes.CDLL("libEGL.so.1")
egl.eglGetCurrentDisplay.restype = ctypes.c_void_p
with Renderer() as first, first.context.current():
    display = egl.eglGetCurrentDisplay()
egl.eglTerminate(ctypes.c_void_p(display))
with Renderer() as second, second.context.current():
    print(second.context is first.context, second.context.gl.buffer(b"abcd").read())
"""
"""A program that ends the display of EGL between two renderers."""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="contexts are made by EGL on Linux alone")
def test_a_context_is_not_used_again_after_the_end_of_its_display() -> None:
    assert output_of(LOST).strip() == "False b'abcd'"


CALLER = """
import moderngl

import decals
from blobtree import Point
from decals.rendering.context import Context

own = moderngl.create_context(standalone=True, backend="egl")
texture = own.texture((2, 2), 1, bytes(range(4)), alignment=1)

def check():
    assert texture.read(alignment=1) == bytes(range(4))

for _ in range(2):
    decals.render(Point((0, 0, 0), radius=1.0), size=(16, 12), samples=1)
    check()
with Context.standalone() as context:
    check()
    with context.current():
        assert context.gl.buffer(b"abcd").read() == b"abcd"
    check()
check()
print("still current")
"""
"""A program with an OpenGL context of its own."""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="contexts are kept on Linux alone")
def test_the_context_of_the_caller_stays_current() -> None:
    """Around a picture, and around contexts and renderers that are made, used and released."""
    assert output_of(CALLER).strip() == "still current"
