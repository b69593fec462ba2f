"""``implicit-decals render``: a picture of models with scattered decals, or of a saved scene."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from decals import Scene, save_scene
from decals.apps.commands.options import (
    MAX_SAMPLES,
    TILE,
    CreaseAngle,
    Inputs,
    OptionalWhole,
    Rules,
    Scattered,
    check_count,
    given,
    parse_size,
)
from decals.apps.commands.progress_bars import preparing
from decals.apps.commands.scatter_options import ScatterOptions, refuse_scattering
from decals.apps.models.loading import load_models
from decals.apps.models.samples import axes_of
from decals.apps.output import PICTURE_SUFFIXES, check_output, print_path
from decals.apps.views import frame, parse_view
from decals.errors import InvalidInput
from decals.rendering import Drawing, Environment, Renderer
from decals.scenes.camera import UPRIGHT
from decals.scenes.render import drawn_picture


def render(
    model: Annotated[list[str], Parameter(negative=())],
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    scattered: Scattered = Scattered(),
    camera: str | None = None,
    size: str = "1200x900",
    samples: OptionalWhole = None,
    rules: Rules = Rules(),
    filtered: Annotated[bool | None, Parameter(negative=(), show_default=False)] = None,
    environment: str | None = None,
    environment_rotation: float | None = None,
    environment_strength: float | None = None,
    environment_visible: Annotated[bool | None, Parameter(negative=(), show_default=False)] = None,
    save: Path | None = None,
    crease_angle: CreaseAngle = None,
    inputs: Inputs = Inputs(),
) -> None:
    """Cover models with decals and draw a picture.

    All models share one coordinate system. Decals continue from one model to another where they touch.

    Parameters
    ----------
    model
        Mesh files (ply, obj, stl, vtp, ...), BlobTrees in JSON, programs (vm, frep), samples (creature,
        dragon, horse, knot, spheres), or one saved scene.
    output
        The picture: png, jpg, webp or tif.
    camera
        View: three-quarter, front, back, left, right, top, bottom, or a direction x,y,z toward the camera.
        Default: three-quarter.
    size
        Width and height of the picture in pixels.
    samples
        Samples per pixel along each axis: 1 is fast, 2 smooth, 4 fine. Default: that of a saved scene, or 2.
    filtered
        Average images, rims and contact lines over each sample, so that one sample a pixel
        shows decals smoothly.
    environment
        Equirectangular picture of all directions as light, in place of the studio light: a Radiance file
        (hdr), or any picture. Its upward axis is the camera's.
    environment_rotation
        Degrees by which the environment turns about the upward axis, counterclockwise from above.
    environment_strength
        Factor of the light of the environment.
    environment_visible
        Show the environment behind the models.
    save
        Also write the scene to this JSON file, which render and edit can open.
    """
    pixels = parse_size(size)
    view = parse_view(camera, axes_of(model[0]) if scattered.up is None else UPRIGHT[scattered.up])
    if samples is not None:
        check_count("--samples", samples, 1, MAX_SAMPLES)
    options: dict[str, Any] = {"samples": samples, "filtered": filtered, **rules.given()}
    changes = given(rotation=environment_rotation, strength=environment_strength, visible=environment_visible)
    if environment is not None:
        options["environment"] = Environment(environment, **changes)
    Drawing().overridden(**options)  # checked before anything slow
    check_output(output, PICTURE_SUFFIXES)
    if save is not None:
        check_output(save, (".json",))
    with ExitStack() as stack:
        progress = stack.enter_context(preparing(inputs.define))
        loaded = load_models(
            model, trust=inputs.trust, crease_angle=crease_angle, table=inputs.table, images=scattered.image
        )
        if isinstance(loaded, Scene):
            refuse_scattering(scattered, inputs.table)
        drawing = (loaded.drawing if isinstance(loaded, Scene) else Drawing()).overridden(**options)
        if changes and environment is None:
            drawing = drawing.overridden(environment=_changed(drawing.environment, changes))
        scattering = ScatterOptions.of(scattered)
        # The renderer comes first: without graphics the command fails before the long work.
        renderer = stack.enter_context(Renderer(max_tile=TILE))
        scene = loaded if isinstance(loaded, Scene) else scattering.scene(loaded, view, pixels, progress)
        if isinstance(loaded, Scene) and (camera is not None or scattered.up is not None):
            scene = scene.replace(camera=frame(scene.objects, view, pixels))
        if environment is not None:
            drawing = drawing.overridden(environment=_changed(drawing.environment, {"up": scene.camera.up}))
        scene = scene.replace(drawing=drawing)
        if save is not None:
            save_scene(scene, save)
        progress("drawing", 0.0)
        drawn_picture(renderer, scene, scene.drawing.at(pixels)).save(output)
    print_path(output)


def _changed(environment: Environment | None, changes: dict[str, Any]) -> Environment:
    """Return an environment with other values, or raise `InvalidInput` without an environment."""
    if environment is None:
        raise InvalidInput("expected an environment that the options change, got none; give --environment")
    return replace(environment, **changes)
