"""The editing window; `decals.editing` has the edits without a window."""

from decals.window.browser import browser_keys, press_key
from decals.window.frame_budget import FrameBudget
from decals.window.window import EditWindow, edit

__all__ = ["EditWindow", "FrameBudget", "browser_keys", "edit", "press_key"]
