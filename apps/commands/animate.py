"""``implicit-decals animate``: a turntable, or a scene in a sequence of poses, as pictures or as a video."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from decals import MeshObject, Scene, pose, turntable
from decals import animate as write_animation
from decals.apps.commands.options import (
    MAX_SAMPLES,
    Inputs,
    OptionalWhole,
    Rules,
    Scattered,
    check_count,
    parse_size,
)
from decals.apps.commands.progress_bars import preparing
from decals.apps.commands.scatter_options import ScatterOptions, refuse_scattering
from decals.apps.models.loading import (
    call_imported,
    import_module_or_file,
    load_models,
)
from decals.apps.models.samples import axes_of
from decals.apps.output import check_animation, print_path
from decals.apps.views import frame, parse_view
from decals.errors import InvalidInput
from decals.rendering import Drawing
from decals.scenes.animation import MAX_FRAMES, VIDEO_SUFFIXES
from decals.scenes.camera import UPRIGHT
from decals.scenes.pose import PosedScene

DEFAULT_FRAMES = 120

Poses = Callable[[float], Any]
"""A function of the time from 0 to 1: positions by names of meshes, or a scene."""


def animate(
    model: Annotated[list[str], Parameter(negative=())],
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    frames: OptionalWhole = None,
    rate: float = 25.0,
    turns: Annotated[float | None, Parameter(show_default=False)] = None,
    poses: Annotated[str | None, Parameter(show_default=False)] = None,
    meshes: Annotated[
        list[str] | None, Parameter(negative=(), show_default=False, consume_multiple=True)
    ] = None,
    rigid: Annotated[bool, Parameter(negative=())] = False,
    scattered: Scattered = Scattered(),
    camera: str | None = None,
    size: str = "800x600",
    samples: OptionalWhole = None,
    rules: Rules = Rules(),
    inputs: Inputs = Inputs(),
) -> None:
    """Draw a turntable, or a scene in a sequence of poses.

    Parameters
    ----------
    model
        Models as for render, or one saved scene.
    output
        A folder for pictures frame_0001.png and so on, in which those of an earlier run are replaced, and
        later ones removed; or a video that ends in .gif or .mp4. For .mp4 the package imageio-ffmpeg is
        needed.
    frames
        Number of frames. Default: 120, or the number of meshes.
    rate
        Frames per second of a video.
    turns
        Turns of the camera about the upward axis through its target. Default: 1 without poses, 0 with them.
    poses
        A Python file or module with a function pose(t). For t from 0 to almost 1 it returns the positions of
        the vertices by names of meshes, as decals.pose takes them, or a scene. Its code is run.
    meshes
        Mesh files, one for each frame: the vertices of the scene's only mesh, in its order.
    rigid
        Keep the shapes of decals in poses; they then turn with the nearest triangle.
    camera
        View of the first frame, as for render.
    size
        Width and height of the pictures in pixels.
    samples
        Samples per pixel along each axis. Default: that of a saved scene, or 2.
    """
    pixels = parse_size(size)
    view = parse_view(camera, axes_of(model[0]) if scattered.up is None else UPRIGHT[scattered.up])
    if samples is not None:
        check_count("--samples", samples, 1, MAX_SAMPLES)
    if poses is not None and meshes:
        raise InvalidInput("expected --poses or --meshes, got both; leave one out")
    if frames is not None:
        check_count("--frames", frames, 1, MAX_FRAMES)
    count = frames or (len(meshes) if meshes else DEFAULT_FRAMES)
    check_animation(output, VIDEO_SUFFIXES)
    Drawing().overridden(**rules.given())  # checked before anything slow
    with preparing(inputs.define) as progress:
        function = _pose_function(poses) if poses is not None else None
        loaded = load_models(model, trust=inputs.trust, table=inputs.table, images=scattered.image)
        if isinstance(loaded, Scene):
            refuse_scattering(scattered, inputs.table)
            scene = loaded
            if camera is not None or scattered.up is not None:
                scene = scene.replace(camera=frame(scene.objects, view, pixels))
        else:
            scene = ScatterOptions.of(scattered).scene(loaded, view, pixels, progress)
        if meshes:
            function = _mesh_function(scene, meshes)
        whole = turns if turns is not None else float(function is None)
        cameras = turntable(scene, count, turns=whole)
        posed = cameras if function is None else _posed(cameras, function, rigid=rigid)
        drawn = (replace(item, drawing=item.drawing.overridden(**rules.given())) for item in posed)
        write_animation(drawn, output, size=pixels, rate=rate, samples=samples, count=count)
    print_path(output)


def _pose_function(module: str) -> Poses:
    """Return the function of ``--poses``."""
    function: Poses | None = getattr(import_module_or_file("--poses", module), "pose", None)
    if not callable(function):
        raise InvalidInput(f"--poses {module}: expected a function pose(t), found none; define one")
    return lambda t: call_imported("--poses", module, function, t)


def _mesh_function(scene: Scene, files: Sequence[str]) -> Poses:
    """Return the function whose poses are the meshes of files, one after another."""
    names = [item.name for item in scene.objects if isinstance(item, MeshObject)]
    if len(names) != 1:
        raise InvalidInput(f"--meshes: expected a scene with one mesh, got {len(names)}; use --poses")

    def mesh(t: float) -> Any:
        loaded = load_models([files[min(int(t * len(files) + 1e-6), len(files) - 1)]])
        item = None if isinstance(loaded, Scene) else loaded[0]
        if not isinstance(item, MeshObject):
            raise InvalidInput("--meshes: expected mesh files, got a scene or a tree; use --poses")
        return {names[0]: item}

    return mesh


def _posed(
    frames: Sequence[Scene | PosedScene], function: Poses, *, rigid: bool
) -> Iterator[Scene | PosedScene]:
    """Yield each frame in its pose."""
    for number, scene in enumerate(frames):
        found = function(number / len(frames))
        if isinstance(found, Scene | PosedScene):
            yield replace(found, camera=scene.camera)
        else:
            assert isinstance(scene, Scene)
            yield pose(scene, found, rigid=rigid)
