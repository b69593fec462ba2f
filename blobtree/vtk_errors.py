"""Errors that VTK reports: collected instead of printed."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import pyvista as pv
from vtkmodules.vtkCommonCore import vtkLogger


@contextmanager
def vtk_errors() -> Iterator[list[str]]:
    """Collect the errors that VTK reports within a ``with`` block; the list is full after the block."""
    messages: list[str] = []
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    root_level = logging.root.manager.disable
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    logging.disable(logging.CRITICAL)  # pyvista's readers and writers send VTK's errors there as well
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            with pv.VtkErrorCatcher(send_to_logging=False) as catcher:
                yield messages
        # A truncated file of the legacy format comes as a warning, and as arrays that are not filled.
        messages.extend(
            event.alert.rpartition("\n")[2] if event.kind == "" else event.alert
            for event in catcher.events
            if event.kind == "ERROR" or "Error reading" in event.alert
        )
        # An error inside one of pyvista's readers comes as a warning that quotes it.
        messages.extend(
            str(w.message).partition('"')[2] for w in caught if "raised an error" in str(w.message)
        )
    finally:
        logging.disable(root_level)
        vtkLogger.SetStderrVerbosity(verbosity)
