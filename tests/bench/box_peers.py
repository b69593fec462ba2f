"""Decals and pixels in, milliseconds of the decal pass out, beside projected boxes in the same shader.

    python -m tests.bench.box_peers dragon --json rates.json

All passes read the same G-buffer, through the same kind of shader, and write the same target:

* *contact*: decals in ELASTIC contact;
* *no contact*: the same decals, of which each shows undeformed over those before it (`Interaction.OVERLAP`);
* *boxes*: projected boxes of engines, `projected_boxes.py`. The same index lists the boxes that may contain a
  point. Those that do are blended over each other, from the last one down, until nothing shows through.

A box is as wide as its decal and half as deep. Times are medians of OpenGL timer queries. The table is in
Markdown.
"""

import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import moderngl
import numpy as np

from blobtree.transpile.glsl import translate_library
from decals import Contact, Decals, Interaction, Scene
from decals.index.lookup import cell_range
from decals.record import NEIGHBOR_REACH, RIM_RADIUS
from decals.rendering import Context, Renderer, RenderOptions
from decals.rendering.decal_data import DecalData
from decals.rendering.decal_library import Form
from decals.rendering.decal_pass import BODY, DecalSource, decal_programs
from decals.rendering.frame_plan import decal_source, plan_frame
from decals.rendering.gbuffer import GBuffer
from decals.rendering.image_array import ImageArray
from decals.rendering.options import viewpoint_of
from decals.rendering.pixel_pass import PassBackend, PixelPass, Program, set_uniform, use_textures
from decals.rendering.targets import WHOLE_SLOT
from decals.rendering.viewpoint import WHOLE, PictureView, Rectangle
from tests.bench.command_line import bench_parser, write
from tests.bench.projected_boxes import FULL
from tests.bench.scenes import bench_scene

COUNTS = 100, 1_000, 10_000, 100_000
SIZES = (1280, 720), (1920, 1080), (3840, 2160)
KINDS = "contact", "no contact", "boxes"
RUNS = 25

WARM_SECONDS = 1.0
"""Seconds of passes before those that are timed: a card at rest runs at a fraction of its clock."""

DEPTH = 0.5
"""Half the depth of a box over half its width."""

GROWTH = float(np.hypot(np.sqrt(2.0), DEPTH) * RIM_RADIUS / NEIGHBOR_REACH)
"""Radius of a record whose entry in the index reaches the corners of a box, over half the box's width."""

BOX_SHADER = f"""
//@ include decal_data.glsl
//@ slot functions

struct DecalHit {{ int owner; float field; vec2 uv; }};

DecalHit decal_at(vec3 q, vec3 n) {{ return DecalHit(-1, 0.0, vec2(0.0)); }}

vec4 box_texel(int i) {{ return fetch_decal_records(ivec2(i & 4095, i >> 12), 0); }}

// Premultiplied linear colour of all boxes at a point, over each other.
vec4 color_from(DecalHit hit, vec3 q, vec3 n, vec3 right, vec3 up) {{
    vec4 color = vec4(0.0);
    for (int level = 0; level < index_level_count; level++) {{
        ivec2 span = cell_range(q, level);
        for (int j = span.y - 1; j >= span.x && color.a < OPAQUE; j--) {{
            int box = texelFetch(index_ids, ivec2(j & 4095, j >> 12), 0).x;
            vec4 place = box_texel(4 * box);
            vec3 axis = box_texel(4 * box + 1).xyz;
            vec4 u = box_texel(4 * box + 2);
            mat3 frame = mat3(u.xyz, cross(axis, u.xyz), axis) / (place.w * {RIM_RADIUS / GROWTH:.9g});
            vec3 local = (q - place.xyz) * frame;
            if (any(greaterThan(abs(local), vec3(1.0, 1.0, {DEPTH})))) {{
                continue;
            }}
            vec4 tint = box_texel(4 * box + 3);
            float shown = tint.w * clamp(dot(n, axis) / {FULL}, 0.0, 1.0);
            vec2 dx = 0.5 * (right * frame).xy, dy = 0.5 * (up * frame).xy;
            vec4 texel = textureGrad(decal_images, vec3(0.5 + 0.5 * local.xy, u.w), dx, dy);
            color += (1.0 - color.a) * shown * texel * vec4(tint.rgb, 1.0);
        }}
    }}
    return color;
}}
"""
"""The part of the decal pass that `shaders/decals.glsl` fills for decals."""


def boxes_of(decals: Decals) -> Decals:
    """Return decals of the boxes of others: the index lists them wherever a box may contain a point."""
    return decals.replace(radii=GROWTH * decals.radii)


def without_contact(decals: Decals) -> Decals:
    """Return the decals undeformed, each over those before it."""
    return decals.replace(interactions=np.full(len(decals), Interaction.OVERLAP))


def box_program(context: Context) -> Program:
    """Return the decal pass with boxes in place of decals."""
    functions = Form(Contact.ELASTIC).constants + translate_library((cell_range,))
    slots = {"decals": BOX_SHADER, "functions": functions}
    return context.pixel_program(BODY, 1, slots=slots, defines={"DECALS": True})


@dataclass(frozen=True)
class Stage:
    """A G-buffer with a scene's surface in it, and all that decal passes over it need."""

    renderer: Renderer
    gbuffer: GBuffer
    target: moderngl.Texture
    images: ImageArray
    source: DecalSource
    options: RenderOptions

    def painting(self, kind: str, decals: Decals) -> tuple[PixelPass, DecalData]:
        """Return the pass over all pixels that paints decals in one of `KINDS`, and its decals."""
        context = self.renderer.context
        change: dict[str, Any] = {"contact": Decals.replace, "no contact": without_contact, "boxes": boxes_of}
        source = replace(self.source, decals=DecalData(context, change[kind](decals)))
        program = box_program(context) if kind == "boxes" else decal_programs(context, source.form)[0]
        g = self.gbuffer
        use_textures(program, {"g_position": g.position, "g_normal": g.normal, "g_color": g.color})
        self.images.use(3)
        set_uniform(program, "decal_images", 3)
        source.use(program, 4)
        return PixelPass(context.gl, program, [self.target]), source.decals

    def run(self, painting: PixelPass) -> None:
        """Paint the target."""
        painting.run(Rectangle(0, 0, *self.options.size))

    def milliseconds(self, kind: str, decals: Decals, runs: int) -> float:
        """Return the median time of a pass."""
        painting, data = self.painting(kind, decals)
        gl = self.renderer.context.gl
        end = time.perf_counter() + WARM_SECONDS
        while time.perf_counter() < end:
            self.run(painting)
            gl.finish()
        query = gl.query(time=True)
        times = []
        for _ in range(runs):
            with query:
                self.run(painting)
            times.append(1e-6 * query.elapsed)
        painting.release()
        data.release()
        return statistics.median(times)

    def pixels(self, texture: moderngl.Texture) -> Any:
        """Return the values of a texture, the lowest row first."""
        width, height = self.options.size
        values = np.frombuffer(texture.read(), f"f{texture.dtype[1]}").reshape(height, width, 4)
        return values.astype(np.float64)


@contextmanager
def staged(scene: Scene, size: tuple[int, int], backend: PassBackend | None = None) -> Iterator[Stage]:
    """Draw the surface of a scene, and leave its context current."""
    options = RenderOptions(size=size, samples=1)
    with Context.standalone(backend=backend) as context, Renderer(context) as renderer, context.current():
        uploaded = renderer._uploads.scene(scene, options)
        tile = PictureView.of(viewpoint_of(scene, None), size, uploaded.bounds).whole()
        targets = renderer._targets.of(WHOLE_SLOT, size)
        renderer._camera.use(tile)
        for step in plan_frame(scene, uploaded, tile, options, targets, None, depth=False).steps:
            step(WHOLE)
        source = decal_source(uploaded, options)
        assert source is not None
        assert uploaded.images is not None
        yield Stage(renderer, targets.gbuffer, targets.decal_pass.paint, uploaded.images, source, options)


def measure(
    model: str, counts: list[int], sizes: list[tuple[int, int]], runs: int, backend: PassBackend | None = None
) -> dict[str, float]:
    """Return milliseconds by kind, number of decals and size."""
    figures: dict[str, float] = {}
    scenes = {count: bench_scene(model, count, sizes[0]) for count in counts}
    for width, height in sizes:
        with staged(bench_scene(model, counts[0], (width, height)), (width, height), backend) as stage:
            figures[f"covered_{width}x{height}"] = float(
                (stage.pixels(stage.gbuffer.color)[..., 3] > 0).mean()
            )
            for count, scene in scenes.items():
                for kind in KINDS:
                    key = f"{kind.replace(' ', '_')}_{count}_{width}x{height}_ms"
                    figures[key] = stage.milliseconds(kind, scene.decals, runs)
    return figures


def table(figures: dict[str, float], counts: list[int], sizes: list[tuple[int, int]]) -> str:
    """Return the figures as a table in Markdown, with the decals for each millisecond at the largest size."""
    names = [f"{width}x{height}" for width, height in sizes]
    heads = [f"{name.replace('x', ' × ')} ({figures[f'covered_{name}']:.0%} covered)" for name in names]
    lines = [
        f"{', '.join(KINDS)}, ms",
        "",
        f"| decals | {' | '.join(heads)} | decals a ms, {names[-1].replace('x', ' × ')} |",
        "| ---: |" + " ---: |" * (len(names) + 1),
    ]
    for count in counts:
        times = {
            name: [figures[f"{kind.replace(' ', '_')}_{count}_{name}_ms"] for kind in KINDS] for name in names
        }
        cells = [" / ".join(f"{value:.3g}" for value in times[name]) for name in names]
        rates = " / ".join(f"{float(f'{count / value:.3g}'):,.0f}" for value in times[names[-1]])
        lines.append(f"| {count:,} | {' | '.join(cells)} | {rates} |")
    return "\n".join(lines)


def size_of(text: str) -> tuple[int, int]:
    """Return width and height of a text such as 1280x720."""
    width, height = map(int, text.split("x"))
    return width, height


def main() -> None:
    """Measure and print."""
    parser = bench_parser("box_peers", __doc__)
    parser.add_argument("model", help="dragon, horse or knot, or the file of a mesh")
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS)
    parser.add_argument("--sizes", type=size_of, nargs="+", default=SIZES)
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--backend", type=PassBackend, help="fragment or compute; by default the faster one")
    options = parser.parse_args()
    figures = measure(options.model, options.counts, options.sizes, options.runs, options.backend)
    print(table(figures, options.counts, options.sizes))
    write(options.json, figures)


if __name__ == "__main__":
    main()
