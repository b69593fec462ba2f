"""A window in which scenes are edited by hand; `decals.edit` is what happens, this is where.

`view` opens one and gives the edited scene.
"""

from decals.window.browser import browser_keys, press_key
from decals.window.quality import Quality
from decals.window.window import EditWindow, view

__all__ = ["EditWindow", "Quality", "browser_keys", "press_key", "view"]
