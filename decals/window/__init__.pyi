from .browser import browser_keys, press_key
from .frames import FrameBudget
from .window import EditWindow, edit

__all__ = ["EditWindow", "FrameBudget", "browser_keys", "edit", "press_key"]
