from .browser import browser_keys, press_key
from .frames import FrameBudget
from .opening import edit
from .window import EditWindow

__all__ = ["EditWindow", "FrameBudget", "browser_keys", "edit", "press_key"]
