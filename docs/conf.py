"""Sphinx configuration of the documentation; `make docs` builds it.

Set DOCS_GALLERY=0 to build it without running the gallery scripts. They never run where OpenGL is missing.
"""

import os
import sys
from importlib import metadata
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))

import api_pages  # noqa: E402
import node_pages  # noqa: E402
import page_examples  # noqa: E402
from gallery_scripts import GalleryArguments, PictureScraper  # noqa: E402

from blobtree.graphics import missing_gl_libraries  # noqa: E402
from decals.apps.gallery import DOWNLOADED  # noqa: E402

project = "Implicit Decals"
author = "Implicit Decals contributors"
copyright = author  # noqa: A001
version = release = metadata.version("implicit-decals")

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["examples/*.ipynb"]
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3

api_pages.write(DOCS / "api")
node_pages.write(DOCS / "nodes")
page_examples.write(DOCS / "extra")
html_extra_path = ["extra"]
autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False

html_theme = "pydata_sphinx_theme"
html_title = project
html_theme_options = {"show_toc_level": 2, "navigation_with_keys": False, "navbar_align": "left"}

run_gallery = os.environ.get("DOCS_GALLERY", "1") != "0" and not missing_gl_libraries()
no_downloads = "" if os.environ.get("PYVISTA_DATA") else f"(?!{'|'.join(DOWNLOADED)})"
sphinx_gallery_conf = {
    "examples_dirs": str(DOCS.parent / "apps" / "gallery"),
    "gallery_dirs": "examples",
    "filename_pattern": rf"/{no_downloads}[a-z_]+\.py$",
    "ignore_pattern": r"(__init__|helpers)\.py",
    "plot_gallery": str(run_gallery),
    "reset_argv": GalleryArguments(),
    "image_scrapers": (PictureScraper(),),
    "download_all_examples": False,
    "show_signature": False,
    "min_reported_time": 1_000_000,
    "write_computation_times": False,
}
