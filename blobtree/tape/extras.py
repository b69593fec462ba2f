"""Evaluations beyond those of the core, imported at the first use: of operators that read gradients."""

from typing import Any


def gradient_evaluations() -> dict[Any, Any]:
    """Return evaluations of trees with operators that read gradients, by those of other trees."""
    from blobtree.tape.directed import DIRECTED_EVALUATIONS

    return DIRECTED_EVALUATIONS


def gradient_evaluators() -> tuple[Any, Any]:
    """Return the evaluators of bounds and of colours for such operators."""
    from blobtree.tape.directed import DIRECTED_BOUND, DIRECTED_COLOR

    return DIRECTED_BOUND, DIRECTED_COLOR


def gradient_steps() -> Any:
    """Return the module of the steps of such an evaluation, with their changes along a way."""
    from blobtree.tape import directed_along

    return directed_along
