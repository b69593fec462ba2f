"""Start Warp without its remark that there is no CUDA driver, which it cannot be asked to leave out."""

import os
import sys
import tempfile

import warp as wp

_REMARK = "Could not find or load the NVIDIA CUDA driver"


def start_warp() -> None:
    """Start Warp; whatever else it says is said again.

    Everything runs without CUDA as well, and ``implicit-decals doctor`` tells which devices there are.
    """
    try:
        kept = os.dup(2)
    except OSError:  # no stderr to keep clean
        wp.init()
        return
    sys.stderr.flush()
    with tempfile.TemporaryFile() as heard:
        os.dup2(heard.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
        heard.seek(0)
        lines = heard.read().decode(errors="replace").splitlines(keepends=True)
    sys.stderr.write("".join(line for line in lines if _REMARK not in line))
