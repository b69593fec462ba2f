from .page import Page, page, viewer_script

__all__ = [
    "Page",
    "page",
    "viewer_script",
]
