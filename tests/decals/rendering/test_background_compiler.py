"""Programs that a thread compiles: what waits for them, and that the driver finds them in its cache."""

import ctypes
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import moderngl
import pytest

from decals.errors import NoGraphics
from decals.rendering import Context, background_compiler
from decals.rendering.background_compiler import GL, BackgroundCompiler, draw_nothing, draw_state
from decals.rendering.current_context import system_library
from decals.shaders import CompileError, Source
from tests.programs import output_of

CURRENT_PROGRAM = 0x8B8D
VERTEX = Source.named("v", "#version 330 core\nvoid main() { gl_Position = vec4(0.0); }\n\n")
FRAGMENT = """#version 330 core
uniform sampler2D one; uniform isampler2D unused; uniform sampler2DArray many; uniform sampler3D solid;
out vec4 color;
void main() { color = texelFetch(one, ivec2(0), 0) + texture(many, vec3(0.5)) + texture(solid, vec3(0.5)); }
"""

pytestmark = pytest.mark.skipif(
    system_library(GL) is None, reason="without this library of Linux nothing is compiled in a thread"
)


@pytest.fixture
def compiler(context: Context) -> Iterator[tuple[BackgroundCompiler, threading.Event]]:
    """A compiler whose context is made once an event is set."""
    go = threading.Event()

    def make() -> Context:
        assert go.wait(60)
        return Context.standalone()

    yield BackgroundCompiler(make), go
    go.set()


def repeated(attempt: Callable[[], bool]) -> None:
    """Repeat an attempt until it succeeds."""
    assert any(attempt() for _ in range(6000))


def test_work_is_repeated_until_the_thread_has_linked_its_program(
    context: Context,
    compiler: tuple[BackgroundCompiler, threading.Event],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    threads, done = [], []
    link = system_library(GL).glLinkProgram

    def noted(program: int) -> int:
        threads.append(threading.current_thread())
        return int(link(program))

    monkeypatch.setattr(system_library(GL), "glLinkProgram", noted)
    making, go = compiler
    fragment = Source.named("f", FRAGMENT + "// linked in a thread\n")

    def work() -> None:
        context.program(VERTEX, fragment)
        done.append(True)

    with context.compiling_in_thread(making):
        for _ in range(3):
            assert not context.attempt(work)
        assert not threads
        assert (VERTEX.text, fragment.text) not in context._programs._kept
        go.set()
        repeated(lambda: context.attempt(work))
        assert [thread is threading.current_thread() for thread in threads] == [False]
        assert context.attempt(work)
    assert len(done) == 2


def shader_texts(program: int) -> list[bytes]:
    """Return the texts of a program's shaders, as the driver has them."""
    library, count = system_library(GL), ctypes.c_int()
    shaders, text = (ctypes.c_uint * 2)(), ctypes.create_string_buffer(10_000)
    library.glGetAttachedShaders(program, 2, ctypes.byref(count), shaders)
    texts = []
    for shader in shaders[: count.value]:
        library.glGetShaderSource(shader, len(text), None, text)
        texts.append(text.value)
    return texts


def test_the_driver_gets_the_texts_that_moderngl_sends(context: Context) -> None:
    """Caches of drivers go by the text; moderngl strips it, but not that of compute shaders."""
    compute = "\n#version 430 core\nlayout(local_size_x=1) in;\nvoid main() {}\n\n"
    window = context.gl.program(vertex_shader=VERTEX.text, fragment_shader=FRAGMENT)
    programs: list[tuple[tuple[str, ...], Any]] = [((VERTEX.text, FRAGMENT), window)]
    if context.gl.version_code >= 430:
        programs.append(((compute,), context.gl.compute_shader(compute)))
    for sources, expected in programs:
        own = background_compiler._link(sources)
        assert len(shader_texts(own)) == len(sources)
        assert shader_texts(own) == shader_texts(expected.glo)
        background_compiler._delete(own)
        expected.release()


def test_outside_an_attempt_nothing_is_waited_for(
    context: Context, compiler: tuple[BackgroundCompiler, threading.Event]
) -> None:
    with context.compiling_in_thread(compiler[0]):
        context.program(VERTEX, Source.named("f", FRAGMENT + "// at once\n"))
    assert context.attempt(lambda: context.program(VERTEX, Source.named("f", FRAGMENT + "// later\n")))


def test_errors_are_raised_where_the_window_compiles(
    context: Context, compiler: tuple[BackgroundCompiler, threading.Event]
) -> None:
    making, go = compiler
    go.set()
    with context.compiling_in_thread(making), pytest.raises(CompileError):
        repeated(lambda: context.attempt(lambda: context.program(VERTEX, Source.named("f", "nonsense"))))


def test_without_a_context_for_the_thread_the_window_compiles(context: Context) -> None:
    def refuse() -> Context:
        raise NoGraphics("no context for a thread")

    fragment = Source.named("f", FRAGMENT + "// without a thread\n")
    with context.compiling_in_thread(BackgroundCompiler(refuse)):
        repeated(lambda: context.attempt(lambda: context.program(VERTEX, fragment)))
    assert (VERTEX.text, fragment.text) in context._programs._kept


def test_the_state_of_a_draw_can_be_set_in_another_context(context: Context) -> None:
    gl = context.gl
    program = context.program(VERTEX, Source.named("f", FRAGMENT))
    one, many = gl.texture((4096, 5), 4, dtype="f4"), gl.texture_array((16, 9, 7), 4, dtype="f2")
    solid = gl.texture3d((2, 32, 33), 1, dtype="f1")
    one.filter = (moderngl.NEAREST, moderngl.NEAREST)
    many.build_mipmaps()
    many.filter, many.repeat_x = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR), False
    samplers: dict[str, Any] = {"one": one, "many": many, "solid": solid}
    for unit, (name, texture) in enumerate(samplers.items(), 2):
        texture.use(unit)
        program[name] = unit
    targets = [gl.texture((30, 20), 4, dtype="f4"), gl.texture((30, 20), 2, dtype="f2")]
    depth = gl.depth_texture((30, 20))
    framebuffer = gl.framebuffer(targets, depth)
    framebuffer.use()
    gl.enable_only(moderngl.DEPTH_TEST)
    gl.depth_func = "<"
    state = draw_state(gl, program)
    sizes = {texture.name: texture.size for texture in state.textures}
    assert sizes == {"one": (4, 3, 1), "many": (4, 3, 3), "solid": (2, 4, 3)}
    assert (state.targets, state.depth) == (((4, "f4"), (2, "f2")), True)
    seen = []
    draw = system_library(GL).glDrawArrays

    def noted(*arguments: int) -> int:
        used = ctypes.c_int()
        system_library(GL).glGetIntegerv(CURRENT_PROGRAM, ctypes.byref(used))
        seen.append(draw_state(other.gl, SimpleNamespace(glo=used.value)))  # type: ignore[arg-type]
        return int(draw(*arguments))

    with Context.standalone() as other, other.current(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(system_library(GL), "glDrawArrays", noted)
        draw_nothing(other.gl, (VERTEX.text, FRAGMENT), state)
    assert seen == [state]
    gl.enable_only(moderngl.NOTHING)
    for resource in (depth, *targets, *samplers.values()):
        resource.release()
    framebuffer.release()


COMPILED = """
import os, time
from decals.rendering import background_compiler, pixel_pass
from decals.window import EditWindow
from tests.decals.editing.scenes import scene

made = {"thread": 0, "window": 0}

def counted(name, work):
    def run(*arguments):
        before = count()
        work(*arguments)
        made[name] += count() - before
    return run

def count():
    time.sleep(0.2)  # the driver writes in threads of its own
    return sum(len(files) for _, _, files in os.walk(os.environ["MESA_SHADER_CACHE_DIR"]))

def render(array, vertices):
    array.render(vertices=vertices)
    array.ctx.finish()

def draw(array, vertices):
    array.program.extra(array.program)
    (render if array.program.glo in drawn else first)(array, vertices)
    drawn.add(array.program.glo)

with EditWindow(scene(), off_screen=True, size=(160, 120)) as window:
    window.show()
    subplot = window.subplot
    subplot.draw_scale, subplot.contact, subplot.keep_previous_frame = 0.25, "radial", True
    background_compiler.draw_nothing = counted("thread", background_compiler.draw_nothing)
    first, pixel_pass.draw, drawn = counted("window", render), draw, set()
    window.plotter.render()
    assert subplot.warming_up
    while subplot.warm(0.04) is not None:
        pass
    print(subplot.renderer.context.software, made["thread"], made["window"])
"""


@pytest.mark.slow
def test_the_driver_finds_in_its_cache_what_the_thread_has_compiled(tmp_path: Path) -> None:
    """Programs that the thread draws first add nothing to the cache when the window draws them."""
    environment = {**os.environ, "MESA_SHADER_CACHE_DIR": str(tmp_path)}
    software, thread, window = output_of(COMPILED, env=environment).split()[-3:]
    if software == "False":
        pytest.skip("this driver is not Mesa's software rasteriser, whose cache is looked at")
    assert int(thread) > 0
    assert int(window) == 0
