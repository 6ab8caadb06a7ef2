"""The ratio of two curves of error against time, on curves whose ratio is known."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from fronts import Point, front, ratios

EXACT = 1e-9  # roundings of logarithms


def power_law(errors: list[float], power: float, scale: float) -> list[Point]:
    """A curve of time = scale * error^-power, which is a line in logarithms."""
    return [Point("curve", f"{e}", e, scale * e**-power) for e in errors]


def test_power_laws_are_interpolated_exactly() -> None:
    found = ratios([power_law([1e-1, 1e-3], 2.0, 3.0)], power_law([1e-1, 1e-2, 1e-4], 1.0, 1.0), 5)
    assert (found[0].error, found[-1].error) == (1e-3, 1e-1)
    for each in found:
        assert each.value == pytest.approx(3.0 / each.error, rel=EXACT)
        assert each.bound == ""


def test_the_best_of_several_counts() -> None:
    slow, fast = power_law([1e-1, 1e-3], 1.0, 5.0), power_law([1e-1, 1e-2], 1.0, 2.0)
    found = ratios([slow, fast], power_law([1e-1, 1e-3], 1.0, 1.0), 3)
    assert [each.value for each in found] == pytest.approx([5.0, 2.0, 2.0], rel=EXACT)


def test_what_beam_has_no_setting_for_is_a_bound() -> None:
    fastest = 1e-3 / 1e-3
    found = ratios([power_law([1e-1, 1e-2], 1.0, 1.0)], power_law([1e-3, 1e-4], 1.0, 1e-3), 3)
    assert [each.bound for each in found] == [">="] * 3
    assert [each.value for each in found] == pytest.approx([1.0 / each.error / fastest for each in found])


def test_without_a_curve_there_is_no_ratio() -> None:
    assert ratios([[]], power_law([1e-3, 1e-4], 1.0, 1.0), 3) == []


def test_what_is_slower_and_worse_is_no_front() -> None:
    points = [Point("c", "a", 0.1, 1.0), Point("c", "b", 0.2, 2.0), Point("c", "c", 0.05, 3.0)]
    assert [p.setting for p in front(points)] == ["a", "c"]
