"""Numbers that the paper prints, to measure ourselves against."""

from dataclasses import dataclass

_KB, _MB = 1 << 10, 1 << 20


@dataclass(frozen=True)
class PaperRow:
    """A line of figure 14: 1600×1200 pixels, Core 2 Quad at 2.66 GHz (one thread), GeForce 8800 Ultra.

    Attributes
    ----------
    voxels
        Of the octree.
    build
        Seconds to construct it.
    frame
        Milliseconds to draw a picture.
    memory
        Bytes of video memory for decals and octree.
    """

    voxels: int
    build: float
    frame: int
    memory: int


FIGURE_14: dict[tuple[str, int], PaperRow] = {
    ("dragon", 100): PaperRow(697, 0.02, 25, 12 * _KB),
    ("dragon", 1_000): PaperRow(5_753, 0.06, 30, 116 * _KB),
    ("dragon", 10_000): PaperRow(58_905, 0.78, 32, int(1.14 * _MB)),
    ("knot", 100): PaperRow(897, 0.02, 25, 14 * _KB),
    ("knot", 1_000): PaperRow(8_657, 0.09, 25, 127 * _KB),
    ("knot", 10_000): PaperRow(56_217, 0.80, 26, int(1.13 * _MB)),
    ("horse", 100): PaperRow(48_121, 0.02, 25, 197 * _KB),
    ("horse", 1_000): PaperRow(130_833, 1.23, 25, 605 * _KB),
    ("horse", 10_000): PaperRow(261_561, 2.58, 26, int(1.91 * _MB)),
    ("spheres", 100): PaperRow(921, 0.02, 25, 13 * _KB),
    ("spheres", 1_000): PaperRow(7_393, 0.16, 26, 123 * _KB),
    ("spheres", 10_000): PaperRow(69_889, 1.28, 26, int(1.18 * _MB)),
}
"""By model and number of decals."""
