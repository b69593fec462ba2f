"""The size of frames follows the time that they take."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from decals.window import FrameBudget
from decals.window.frames import SCALES, TARGET_SECONDS


def settled(fixed: Any, each: Any, frames: Any = 12) -> Any:
    """What is chosen on a machine that takes so long for any frame and for one of the window's size."""
    quality = FrameBudget()
    quality.record(2.0, fixed + 4 * each)
    for _ in range(frames):
        quality.record(quality.scale, fixed + each * quality.scale**2)
    return quality


@given(st.floats(0, 0.06), st.floats(1e-4, 10))
def test_frames_of_what_moves_are_done_in_time_if_they_can_be(fixed: Any, each: Any) -> None:
    quality = settled(fixed, each)
    smallest = fixed + each * SCALES[-1] ** 2
    assert fixed + each * quality.scale**2 <= max(TARGET_SECONDS, smallest) * 1.01
    larger = [scale for scale in SCALES if scale > quality.scale]
    if larger and fixed + each * min(larger) ** 2 < 0.6 * TARGET_SECONDS:
        pytest.fail(f"{quality.scale} is smaller than it need be")


def test_a_fast_machine_draws_whole_frames() -> None:
    quality = settled(0.001, 0.005)
    assert quality.scale == 1.0
    assert quality.expected(2.0) == pytest.approx(0.021)


def test_a_first_frame_that_compiled_is_soon_forgotten() -> None:
    quality = FrameBudget()
    quality.record(1.0, 3.0)
    assert quality.scale == SCALES[-1]
    for _ in range(len(SCALES)):
        quality.record(quality.scale, 0.001 + 0.002 * quality.scale**2)
    assert quality.scale == 1.0


def test_a_choice_stays_while_times_waver() -> None:
    quality = settled(0.01, 0.6)
    chosen = {quality.scale}
    for number in range(50):
        wavering = (0.01 + 0.6 * quality.scale**2) * (1.0 + 0.15 * (number % 2))
        quality.record(quality.scale, wavering)
        chosen.add(quality.scale)
    assert len(chosen) <= 2


def test_before_the_first_frame_everything_is_whole() -> None:
    assert FrameBudget().scale == 1.0
    assert FrameBudget().expected(2.0) == 0.0


@given(st.floats(0.001, 0.06), st.floats(0.1, 10), st.floats(0.001, 0.3))
def test_frames_of_which_a_part_is_drawn_do_not_pass_for_whole_ones(
    fixed: float, each: float, share: float
) -> None:
    quality = settled(fixed, each)
    scale, whole = quality.scale, quality.expected(2.0)
    for _ in range(10):
        quality.record(2.0, fixed + 4 * each * share, share)
    assert (quality.scale, quality.expected(2.0)) == (scale, whole)
    assert quality.expected(2.0, share) == pytest.approx(fixed + 4 * each * share, rel=0.2)
    assert quality.expected(2.0, share / 2) < quality.expected(2.0, share)


def test_a_part_that_was_slow_once_is_tried_again_after_a_whole_frame() -> None:
    quality = settled(0.01, 0.5)
    assert quality.expected(2.0, 0.01) < TARGET_SECONDS
    quality.record(2.0, 0.05, 0.01)
    quality.record(2.0, 3.0, 0.01)
    assert quality.in_time(2.0, 0.01)
    quality.record(2.0, 3.0, 0.01)
    assert not quality.in_time(2.0, 0.01)
    assert quality.expected(1.0, 0.01) < TARGET_SECONDS
    quality.record(1.0, 0.51)
    assert quality.in_time(2.0, 0.01)
    assert not quality.in_time(2.0, 1.0)


def test_a_part_is_drawn_where_nothing_is_faster() -> None:
    """Whatever size, what comes besides takes longer than a frame may: then at least the picture is whole."""
    quality = settled(0.2, 0.5)
    assert quality.scale == SCALES[-1]
    quality.record(2.0, 0.201, 0.001)
    assert quality.in_time(2.0, 0.001)


def test_before_the_first_frame_parts_take_no_time_either() -> None:
    quality = FrameBudget()
    assert quality.expected(2.0, 0.5) == 0.0
    quality.record(2.0, 0.1, 0.5)
    assert quality.expected(2.0, 0.5) == 0.0
    assert quality.scale == 1.0
