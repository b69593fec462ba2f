"""Answers to the questions of the lessons: what a student sets, and a part of the text that follows."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Attempt:
    """Settings of sliders by their labels, the verdict, and words of its text."""

    settings: tuple[tuple[str, float | str], ...]
    right: bool
    words: str


def attempt(words: str, *settings: tuple[str, float | str], right: bool = False) -> Attempt:
    return Attempt(settings, right, words)


PROBE, BLUE, MODE, STEP = "Probe, left and right", "Blue decal, left and right", "Contact mode", "Step"
YELLOW, GREEN = "Yellow ball, up and down", "Stiffness of the green ball"
DECAL = "Decal, left and right"

ANSWERS = [
    [
        attempt("the field ends at s = 1.32"),
        attempt("the probe is not on the rim", ("Visible radius of the decal", 0.908)),
        attempt("On the rim the field is ½", ("Probe, along the line", 0.908), right=True),
    ],
    [
        attempt("The images are apart", (BLUE, 1.1)),
        attempt("the probe is inside one of them", (BLUE, 0.0)),
        attempt("the probe is outside of both", (PROBE, 1.5)),
        attempt("F = 0.5", (PROBE, -0.32), right=True),
    ],
    [
        attempt("of the images are folded"),
        attempt("keep their shape. Elastic", (MODE, "radial")),
        attempt("Elastic contact compresses", (MODE, "elastic"), ("Stiffness", 12.0), right=True),
    ],
    [
        attempt("Of the eye only"),
        attempt("the rock still pushes", ("Interaction of the eye", "overlap")),
        attempt("not under them", ("Interaction of the rock", "overlap")),
        attempt("lies whole on the others", ("Interaction of the rock", "independent"), right=True),
    ],
    [
        attempt("the random particles of the start"),
        attempt("Move the step further", (STEP, 2.0)),
        attempt("Go back to the first", (STEP, 60.0)),
    ],
    [
        attempt("Yellow does not touch"),
        attempt("Make green softer", (YELLOW, 1.5)),
        attempt("not pressed together", ("Green ball", 1.9)),
        attempt("the soft one is dented", ("Green ball", 0.9), (GREEN, 0.1), right=True),
    ],
    [
        attempt("The area of the contact is only"),
        attempt("The balls are apart", ("Green ball", 1.4)),
        attempt("Make green softer", ("Green ball", 0.5)),
        attempt("The area depends on how deep", (GREEN, 0.25), right=True),
    ],
    [
        attempt("onto the bump"),
        attempt("the less it is stretched", (DECAL, 0.9), right=True),
    ],
    [
        attempt("Move the one that shows least"),
        attempt("Move the one that shows least", ("Radius of violet", 0.6)),
        attempt(
            "All four show",
            ("Radius of orange", 0.2),
            ("Radius of violet", 0.2),
            right=True,
        ),
    ],
]
"""For each lesson, attempts one after the other; the first changes nothing."""

SOLVED = [(-0.4, -0.46), (-0.5, 0.61), (0.47, 0.36), (0.62, -0.58)]
"""Centres that reach both pars of the puzzle."""
