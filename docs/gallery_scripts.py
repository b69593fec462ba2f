"""How Sphinx-Gallery runs the scripts of apps/gallery: their arguments, and where their pictures go."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PICTURES = Path(__file__).resolve().parent.parent / "build" / "gallery"
PANEL_SIDE = 180
"""Width and height of a panel, in pixels."""


def picture_of(script: str) -> Path:
    """Return the path of the picture that a script draws."""
    return PICTURES / f"{Path(script).stem}.png"


class GalleryArguments:
    """Command line of a gallery script: a small picture in a known place."""

    def __repr__(self) -> str:
        """Return a constant text, so that Sphinx finds the configuration unchanged."""
        return "GalleryArguments"

    def __call__(self, _conf: dict[str, Any], script: dict[str, Any]) -> list[str]:
        """Return the arguments."""
        PICTURES.mkdir(parents=True, exist_ok=True)
        return ["-o", str(picture_of(script["src_file"])), "--side", str(PANEL_SIDE)]


class PictureScraper:
    """Collects the picture that a gallery script drew."""

    def __repr__(self) -> str:
        """Return a constant text, so that Sphinx finds the configuration unchanged."""
        return "PictureScraper"

    def __call__(self, _block: Any, variables: dict[str, Any], conf: dict[str, Any]) -> str:
        """Move the picture into the site and return its reST."""
        from sphinx_gallery.scrapers import figure_rst

        picture = picture_of(variables["src_file"])
        if not picture.exists():
            return ""
        paths: Iterator[str] = variables["image_path_iterator"]
        target = next(paths)
        shutil.move(picture, target)
        text: str = figure_rst([target], conf["src_dir"])
        return text
