"""Work on many trees at once: which trees go together, and smaller groups where memory is short."""

from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from blobtree.cells.sparse_cells import MIN_CULLED_TEXELS
from blobtree.errors import InvalidNode, InvalidResolution
from blobtree.tape.model import ImplicitModel, checked_tree
from blobtree.validation import describe, items

Result = TypeVar("Result")


def checked_trees(trees: object) -> tuple[ImplicitModel, ...]:
    """Return several trees; raise InvalidNode for other values."""
    listed = None if isinstance(trees, ImplicitModel | str) else items(trees)
    if listed is None:
        raise InvalidNode(f"trees: expected several BlobTree nodes, got {describe(trees)}")
    for number, tree in enumerate(listed):
        try:
            checked_tree(tree)
        except InvalidNode as error:
            raise InvalidNode(f"trees[{number}]: {error}") from None
    return listed


@contextmanager
def of_tree(number: int) -> Iterator[None]:
    """Within a ``with`` block, let an InvalidResolution name the tree."""
    try:
        yield
    except InvalidResolution as error:
        raise InvalidResolution(f"trees[{number}]: {error}") from error


def is_small(tree: ImplicitModel) -> bool:
    """Return True for a tree whose tape is read whole; the work on it alone starves a card."""
    return len(tree.tape.data) < MIN_CULLED_TEXELS


def work_together(
    kinds: Sequence[Hashable | None],
    sizes: Sequence[float],
    most: float,
    joint: Callable[[list[int]], Sequence[Result]],
    single: Callable[[int], Result],
) -> list[Result]:
    """Return the results of all models.

    Models of one kind go together. A joint call takes models up to the size `most`, and is divided if they do
    not fit into memory. A model without a kind, or the only one of its kind, takes a single call.

    Raises
    ------
    InvalidResolution
        A model alone does not fit.
    """
    results: dict[int, Result] = {}

    def several(numbers: list[int]) -> None:
        if len(numbers) == 1:
            with of_tree(numbers[0]):
                results[numbers[0]] = single(numbers[0])
            return
        try:
            results.update(zip(numbers, joint(numbers), strict=True))
        except InvalidResolution:
            middle = len(numbers) // 2
            several(numbers[:middle])
            several(numbers[middle:])

    groups: dict[Hashable, list[int]] = {}
    for number, kind in enumerate(kinds):
        groups.setdefault(("alone", number) if kind is None else kind, []).append(number)
    for group in groups.values():
        for part in _parts(group, sizes, most):
            several(part)
    return [results[number] for number in range(len(kinds))]


def _parts(group: list[int], sizes: Sequence[float], most: float) -> list[list[int]]:
    """Return a group in parts up to the size `most`, of one model at least."""
    parts: list[list[int]] = []
    taken = most
    for number in group:
        taken += sizes[number]
        if taken > most:
            parts.append([])
            taken = sizes[number]
        parts[-1].append(number)
    return parts
