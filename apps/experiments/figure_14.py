"""Figure 14 of the paper: index, frame time and memory for each model and number of decals.

The models dragon and horse are downloaded by pyvista; they are in the larger design alone.
"""

from decals.apps.models.figure_14 import PAPER_ROWS, measure
from decals.experiments import Grid
from decals.rendering import Renderer


def figure_14(model: str, decals: int, width: int = 400, height: int = 300) -> dict[str, float]:
    """Measure a row of figure 14.

    Parameters
    ----------
    model
        A sample model.
    decals
        Number of decals.
    width, height
        Size of a frame in pixels.

    Returns
    -------
    dict
        Cells of the ``index``, its ``build_s``, ``frame_ms`` and ``memory_kb``, medians of three; and the
        ``paper_…`` values of the same, if the paper has them (1600 × 1200 pixels, GeForce 8800 Ultra).
    """
    with Renderer() as renderer:
        (row,) = measure(renderer, model, [decals], (width, height))
    measured = {
        "index": row.cells,
        "build_s": row.build,
        "frame_ms": row.frame,
        "memory_kb": row.memory / 1024,
    }
    if (paper := row.paper) is None:
        return measured
    return measured | {
        "paper_index": paper.voxels,
        "paper_build_s": paper.build,
        "paper_frame_ms": paper.frame,
        "paper_memory_kb": paper.memory / 1024,
    }


experiment = figure_14
design = Grid(model=["knot", "spheres"], decals=[100, 1_000, 10_000])
full = Grid(
    model=sorted({model for model, _ in PAPER_ROWS}),
    decals=[100, 1_000, 10_000, 100_000],
    width=[1600],
    height=[1200],
)
