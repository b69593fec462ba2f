"""``implicit-decals render``: cover models with decals and draw the picture."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.render import Renderer
from decals.scenes.scene import Scene
from decals.scenes.scene_file import save_scene

from ..errors import UsageError
from ..machine.warp_start import start_warp
from ..models.definitions import import_definitions
from ..models.loading import load_models
from ..models.samples import axes_of
from ..output import PICTURE_SUFFIXES, check_output, write_picture
from ..views import UPRIGHT, frame, parse_view
from .coat import Coat
from .options import (
    MAX_SAMPLES,
    TILE,
    Definitions,
    OptionalWhole,
    Whole,
    check_count,
    parse_size,
)
from .progress_bars import progress_bars


def render(
    model: Annotated[list[str], Parameter(negative=())],
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    decals: OptionalWhole = None,
    image: Annotated[list[str] | None, Parameter(negative=(), show_default=False)] = None,
    camera: str | None = None,
    up: Annotated[Literal["x", "y", "z"] | None, Parameter(show_default=False)] = None,
    size: str = "1200x900",
    samples: Whole = 2,
    contact: Literal["paper", "smooth", "radial"] = "paper",
    mapping: Literal["corrected", "chord"] = "corrected",
    seed: OptionalWhole = None,
    save: Path | None = None,
    define: Definitions = None,
) -> None:
    """Cover models with one coat of decals and draw a picture.

    Several models keep their own coordinates; where they touch, the decals run across.

    Parameters
    ----------
    model
        Mesh files (ply, obj, stl, vtp, ...), BlobTrees in JSON, samples (creature, dragon, horse, knot,
        spheres), or one saved scene.
    output
        The picture: png, jpg, webp or tif.
    decals
        How many decals. Default: 500.
    image
        What is on them: eye, rivet, rock, scale or tile, with a colour if you like (scale#b0413e), or a
        picture file. May be given several times; decals choose at random. Default: scale.
    camera
        Where from: three-quarter, front, back, left, right, top, bottom, or a direction x,y,z.
    up
        The axis that points upward, which the cameras go by. Default: y, or what suits the sample.
    size
        Width and height of the picture in pixels.
    samples
        Samples per pixel along each axis: 1 is fast, 2 smooth, 4 fine.
    contact
        How neighbours push each other: as in the paper, smoothly where three meet, or along rays, which never
        folds an image.
    mapping
        How images lie on curved surface: corrected for how it bends, or flat, at the chord's length.
    seed
        The same number gives the same decals. Default: 0.
    save
        Also write the scene to this JSON file, which can be rendered again.
    define
        A Python file or module that defines own kinds of nodes, for BlobTrees in JSON that use them. May be
        given several times.
    """
    pixels = parse_size(size)
    view = parse_view(camera, axes_of(model[0]) if up is None else UPRIGHT[up])
    check_count("--samples", samples, 1, MAX_SAMPLES)
    check_output(output, PICTURE_SUFFIXES)
    if save is not None:
        check_output(save, (".json",))
    start_warp()
    import_definitions(define)
    loaded = load_models(model)
    if isinstance(loaded, Scene) and (decals is not None or image or seed is not None):
        raise UsageError("a saved scene brings its own decals; leave out --decals, --image and --seed")
    coat = Coat.asked(decals, image, seed)
    with (
        Renderer(max_tile=TILE) as renderer,
        progress_bars() as progress,
    ):  # no graphics: say so before the long work
        scene = loaded if isinstance(loaded, Scene) else coat.scene(loaded, view, pixels, progress)
        if isinstance(loaded, Scene) and (camera is not None or up is not None):
            scene = scene.replace(camera=frame(scene.objects, view, pixels))
        if save is not None:
            save_scene(scene, save)
        progress("Drawing", 0.0)
        picture = renderer.render(
            scene,
            size=pixels,
            samples=samples,
            contact=Contact[contact.upper()],
            mapping=Mapping[mapping.upper()],
        )
        write_picture(output, picture)
