"""Launching kernels on every core: Warp runs a CPU launch on one thread, but lets several run at once."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import warp as wp

SLICES_PER_THREAD = 4
"""More slices than threads even out slices of unequal cost."""

SMALLEST_SLICE = 256


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=os.cpu_count(), thread_name_prefix="blobtree")


def launch(kernel: wp.Kernel, count: int, inputs: Sequence[Any], outputs: Sequence[Any], device: str) -> None:
    """Run `kernel` for the indices below `count`; its first parameter is the index that a slice starts at."""
    if count == 0:
        return
    if not wp.get_device(device).is_cpu:
        wp.launch(kernel, dim=count, inputs=[0, *inputs], outputs=[*outputs], device=device)
        return
    slices = min((os.cpu_count() or 1) * SLICES_PER_THREAD, -(-count // SMALLEST_SLICE))
    bounds = [count * i // slices for i in range(slices + 1)]
    wp.load_module(kernel.module, device=device)

    def run(first: int, last: int) -> None:
        wp.launch(kernel, dim=last - first, inputs=[first, *inputs], outputs=[*outputs], device=device)

    if slices == 1:
        run(0, count)
    else:
        list(_threads().map(run, bounds[:-1], bounds[1:]))
