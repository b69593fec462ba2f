"""Random texts of expressions: a generator of programs as libfive, Fidget and MPR write them."""

import numpy as np

Rng = np.random.Generator

SMOOTH = ("add", "sub", "mul", "min", "max", "abs", "neg", "square", "sin", "cos", "atan", "hypot")
"""Operations that are exact in float32 to a few digits less than it has."""

ARITIES = dict.fromkeys(("abs", "neg", "square", "sin", "cos", "atan"), 1)


def program(rng: Rng, clauses: int, operations: tuple[str, ...] = SMOOTH) -> list[str]:
    """The lines of a program whose value is below 0 in a part of the cube from −1 to 1."""
    lines = ["x var-x", "y var-y", "z var-z"]
    names = ["x", "y", "z"]

    def add(operation: str, *operands: str) -> str:
        name = f"_{len(lines):x}"
        lines.append(" ".join((name, operation, *operands)))
        names.append(name)
        return name

    for _ in range(clauses):
        operation = str(rng.choice(operations))
        operands = [str(rng.choice(names)) for _ in range(ARITIES.get(operation, 2))]
        if rng.random() < 0.3:
            operands[-1] = add("const", repr(round(float(rng.uniform(-1.0, 1.0)), 3)))
        add(operation, *operands)
    bounded = add("atan", names[-1])
    ball = add("sub", add("hypot", add("hypot", "x", "y"), "z"), add("const", "0.8"))
    add(str(rng.choice(["min", "max"])), ball, add("sub", bounded, add("const", "0.1")))
    return lines


def letters(rng: Rng, count: int, *, size: float = 0.2) -> list[str]:
    """The lines of a flat text as many rings and bars that min and max join, like `prospero.vm`."""
    lines = ["x var-x", "y var-y"]

    def add(operation: str, *operands: str | float) -> str:
        lines.append(" ".join((f"_{len(lines):x}", operation, *map(str, operands))))
        return f"_{len(lines) - 1:x}"

    shapes: list[str] = []
    for _ in range(count):
        x, y = (add("const", round(float(value), 4)) for value in rng.uniform(-0.9, 0.9, 2))
        dx, dy = add("sub", "x", x), add("sub", "y", y)
        outer, inner = (add("const", round(size * share, 4)) for share in (0.5, 0.3))
        if rng.random() < 0.5:
            squares = add("add", add("square", dx), add("square", dy))
            radius = add("sqrt", squares)
        else:
            radius = add("max", add("abs", dx), add("abs", dy))
        ring = add("max", add("sub", radius, outer), add("sub", inner, radius))
        shapes.append(ring)
    while len(shapes) > 1:
        shapes.append(add("min", shapes.pop(0), shapes.pop(0)))
    return lines
