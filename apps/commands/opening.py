"""Opening of what `edit` and `sandbox` edit: models with decals, a saved scene, or an empty one."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from blobtree.files import exists, is_file
from decals import DecalImage, Scene
from decals.apps.commands.options import DEFAULT_IMAGES, MAX_DECALS, MAX_SEED, Inputs, Start, check_count
from decals.apps.commands.progress_bars import PREPARING, progress_bars
from decals.apps.commands.scatter_options import ScatterOptions
from decals.apps.models.loading import load_models
from decals.apps.models.samples import axes_of
from decals.apps.models.scenes import empty_scene, new_file
from decals.apps.output import check_output
from decals.apps.views import parse_view
from decals.editing import AddImage, recovery_path
from decals.errors import InvalidInput
from decals.scenes.camera import UPRIGHT
from decals.window import EditWindow


@dataclass(frozen=True)
class Opened:
    """A scene to edit, and where it is saved.

    Attributes
    ----------
    scene
        The scene.
    path
        File to save to.
    added
        Images to add to the scene, as the first edits.
    recover
        Reads a recovery file.
    """

    scene: Scene
    path: Path
    added: tuple[DecalImage, ...]
    recover: Callable[[Path], Scene]

    def add_images(self, window: EditWindow) -> None:
        """Add the images to a window's scene."""
        for picture in self.added:
            window.session.do(AddImage(picture))


def check_options(start: Start) -> None:
    """Raise `InvalidInput` for options out of range, before anything slow."""
    if start.decals is not None:
        check_count("--decals", start.decals, 0, MAX_DECALS)
    if start.seed is not None:
        check_count("--seed", start.seed, 0, MAX_SEED)
    if start.save is not None:
        check_output(start.save, (".json",))


def opened(model: list[str] | None, start: Start, inputs: Inputs, pixels: tuple[int, int]) -> Opened:
    """Return the scene that the arguments of a command name; see `decals.apps.commands.edit.edit`."""
    added: tuple[DecalImage, ...] = ()
    path = start.save
    if not model or _is_unsaved(model):
        if start.decals is not None or start.seed is not None or inputs.table is not None:
            raise InvalidInput(
                "an empty scene has no decals; name a model, or leave out --decals, --seed and --table"
            )
        scene = empty_scene(start.image or DEFAULT_IMAGES, UPRIGHT[start.up or "y"])
        path = path or (Path(model[0]) if model else new_file(Path(), "scene", recover=True))
    else:
        with progress_bars() as progress:
            progress(PREPARING, 0.0)
            loaded = load_models(model, trust=inputs.trust, table=inputs.table, images=start.image)
            if isinstance(loaded, Scene):
                if start.decals is not None or start.seed is not None:
                    raise InvalidInput(
                        "a saved scene or table has its own decals; leave out --decals and --seed"
                    )
                scene = loaded
                if inputs.table is None:
                    path, added = path or Path(model[0]), tuple(map(DecalImage.load, start.image or ()))
                else:
                    path = path or new_file(Path(), f"{Path(model[0]).stem}-decals", recover=True)
            else:
                options = ScatterOptions.of(start)
                where = parse_view(None, axes_of(model[0]) if start.up is None else UPRIGHT[start.up])
                scene = options.scene(loaded, where, pixels, progress)
                path = path or new_file(Path(), f"{Path(model[0]).stem}-decals", recover=True)

    def load_recovered(path: Path) -> Scene:
        recovered = load_models([str(path)], trust=inputs.trust)
        if not isinstance(recovered, Scene):
            raise InvalidInput(f"expected a scene in the recovery file {str(path)!r}, got a model")
        return recovered

    return Opened(scene, path, added, load_recovered)


def _is_unsaved(models: list[str]) -> bool:
    """Return True for one scene file that was never saved, with a recovery file beside it."""
    first = Path(models[0])
    return (
        len(models) == 1 and first.suffix == ".json" and not exists(first) and is_file(recovery_path(first))
    )


def report_unsaved(window: EditWindow, command: str) -> None:
    """Say where unsaved changes are, if the window was closed with some."""
    files, console = window.actions.files, Console(stderr=True, soft_wrap=True)
    if files.recovery.exists:
        console.print(
            f"unsaved changes are kept in {files.recovery.path}; "
            f"`implicit-decals {command} {files.path}` opens them",
            highlight=False,
            markup=False,
        )
    elif window.session.modified:
        console.print("closed without saving the last changes", highlight=False)
