"""The index that a page builds and edits has the lists of `DecalIndex` in each cell."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from decals import Contact, Decals
from decals.index import DecalIndex
from decals.index.decal_cells import LEVEL_SHIFT
from decals.model import LAYER_LIMIT
from decals.pages.contents import index_rules, record_rules
from decals.rendering.decal_library import Form
from tests.decals.pages.viewer_scripts import needs_node, run_node

Cells = dict[tuple[float, ...], list[int]]
"""Decals in each cell, by the size and the coordinates of the cell."""

SCRIPT = """
const { DecalSet } = await import("./decals.mjs");
const set = new DecalSet(data.rows, data.rules);
for (const [number, row] of data.edits) set.set(number, row);
const { index } = set;
const cells = [];
for (let slot = 0; slot <= index.mask; slot++) {
  const [x, y, z, head] = index.table.at(slot);
  const list = index.ids.array.subarray(head + 1, head + 1 + index.ids.array[head]);
  if (x >= 0 && list.length) cells.push([x, y, z, ...list]);
}
const levels = Array.from(index.levels.array.subarray(0, 4 * index.levelOf.size));
const records = Array.from(set.records.array.subarray(0, 16 * set.rows.length));
console.log(JSON.stringify({ cells, levels, records }));
"""


def random_decals(seed: int) -> Decals:
    """Return decals of one to six sizes, in one or several layers, near and far from the origin."""
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 120))
    sizes = 10.0 ** random.uniform(-2.5, 0.5, size=int(random.integers(1, 6)))
    return Decals(
        positions=random.normal(size=(count, 3)) * 10.0 ** random.uniform(-1, 2),
        normals=random.normal(size=(count, 3)),
        tangents=random.normal(size=(count, 3)),
        radii=random.choice(sizes, count) * random.uniform(0.9, 1.1, count),
        interactions=random.integers(0, 3, count) if seed % 2 else None,
        layers=random.integers(-1, 2, count) if seed % 3 == 0 else None,
        spill=random.random(count) < 0.3,
        tints=random.random((count, 3)),
        opacities=random.random(count),
    )


def rows_of(decals: Decals) -> list[dict[str, Any]]:
    """Return decals as a scene file has them."""
    names = ("independent", "push", "overlap")
    return [
        {
            "position": decals.positions[i].tolist(),
            "normal": decals.normals[i].tolist(),
            "tangent": decals.tangents[i].tolist(),
            "radius": float(decals.radii[i]),
            "image": int(decals.images[i]),
            "spill": bool(decals.spill[i]),
            "interaction": names[decals.interactions[i]],
            "layer": int(decals.layers[i]),
            "tint": decals.tints[i].tolist(),
            "opacity": float(decals.opacities[i]),
        }
        for i in range(len(decals))
    ]


def cells_of(index: DecalIndex) -> Cells:
    """Return the decals in each cell, by the exponent and the coordinates of the cell."""
    return _by_size(
        index.table[index.table[:, 0] >= 0].tolist(), index.levels, lambda head: _list(index, head)
    )


def _list(index: DecalIndex, head: int) -> list[int]:
    return [int(number) for number in index.ids[head + 1 : head + 1 + index.ids[head]]]


def _by_size(rows: Any, levels: NDArray[Any], numbers: Any) -> Cells:
    found: Cells = {}
    for x, y, z, head in rows:
        level, cell = divmod(x, 1 << LEVEL_SHIFT)
        found[float(levels[level][1]), cell, y, z] = numbers(head)
    return found


def page_index(rows: list[Any], rules: dict[str, Any], edits: list[Any]) -> tuple[Cells, NDArray[Any], Any]:
    """Return the cells, the levels and the records of the index that a page has after edits."""
    found = run_node(
        SCRIPT,
        {
            "rows": rows,
            "edits": edits,
            "rules": record_rules([""], Form(Contact.ELASTIC), 1) | {"index": rules},
        },
    )
    levels = np.array(found["levels"], np.float32).reshape(-1, 4)
    listed = [(*row[:3], row[3:]) for row in found["cells"]]
    return _by_size(listed, levels, list), levels, np.array(found["records"], np.float32)


@needs_node
@pytest.mark.parametrize("seed", range(4))
def test_a_built_index_is_that_of_python(seed: int) -> None:
    decals = random_decals(seed)
    index = DecalIndex.of(decals)
    cells, levels, records = page_index(rows_of(decals), index_rules(index), [])
    assert cells == cells_of(index)
    assert np.array_equal(levels, index.levels)
    assert np.allclose(records.reshape(-1, 4), decals.packed(), rtol=1e-6, atol=1e-7)


@needs_node
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20, 40))
def test_an_index_after_edits_is_that_of_the_decals_then(seed: int) -> None:
    decals, others = random_decals(seed), random_decals(seed + 100)
    random = np.random.default_rng(seed)
    after: list[Any] = list(rows_of(decals))
    edits: list[Any] = []
    for row in rows_of(others):
        number = int(random.integers(0, len(after) + 1))
        new = None if number < len(after) and random.random() < 0.3 else row
        edits.append([number, new])
        after[number : number + 1] = [new]
    rules = index_rules(DecalIndex.of(decals))
    changed, levels, _ = page_index(list(rows_of(decals)), rules, edits)
    fresh, _, _ = page_index(after, rules, [])
    assert changed == fresh
    ranks = {number: decal_rank(row) for number, row in enumerate(after) if row is not None}
    for (size, *_), listed in changed.items():
        low, high = levels[levels[:, 1] == np.float32(size)][0][2:]
        assert all(low <= ranks[number] <= high for number in listed)


@needs_node
def test_exponents_are_right_beside_powers_of_two() -> None:
    script = """
    const { exponentAbove } = await import("./index.mjs");
    console.log(JSON.stringify(data.map(exponentAbove)));
    """
    powers = 2.0 ** np.arange(-60, 60)
    sizes = np.concatenate([powers, np.nextafter(powers, 0), np.nextafter(powers, np.inf)])
    assert run_node(script, sizes.tolist()) == np.frexp(sizes)[1].tolist()


def decal_rank(row: dict[str, Any]) -> int:
    """Return the rank of a decal of a file."""
    layer: int = row["layer"]
    return 4 * (layer + LAYER_LIMIT) + ("independent", "push", "overlap").index(row["interaction"])
