"""Rows are exposed to the light of their own time."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.clock import PS
from cosim.light.light import Light, Piece
from imagers.common.scenery import Course, LightScenery, Still


def test_a_course_is_integrated_piece_by_piece() -> None:
    """Constant 2 until 1 s, a ramp to 4 at 2 s, a jump to 10, which stays."""
    course = Course(((PS, 2.0), (2 * PS, 4.0), (2 * PS, 10.0)))
    begin = np.array([0, PS, PS, 2 * PS, 0])
    end = np.array([PS, 2 * PS, PS + PS // 2, 3 * PS, 3 * PS])
    assert course.integral(begin, end) == pytest.approx([2.0, 3.0, 1.25, 10.0, 15.0])
    assert [course.at(t) for t in (0, PS, 3 * PS // 2, 2 * PS, 9 * PS)] == [2, 2, 3, 10, 10]
    late = np.array([10**6 * PS])
    assert course.integral(late, late + 1_000_000)[0] == pytest.approx(1e-5, rel=1e-12)


def test_rows_of_a_rolling_shutter_see_their_own_time() -> None:
    still = Still(np.full((4, 3), 5.0), Course(((0, 0.0), (PS, 1.0))))
    begin = np.array([0, PS // 2])
    seen = still.lux_seconds(1, begin, begin + PS // 2)
    assert seen == pytest.approx(np.array([[0.625] * 3, [1.875] * 3]))


def test_light_in_pieces_is_the_closed_form() -> None:
    one, two = np.full((4, 3), 1, np.float32), np.full((4, 3), 3, np.float32)
    light = Light((Piece(0, PS, one, two), Piece(PS, 2 * PS, two, two)))
    scene = LightScenery((4, 3), lambda a, b: light)
    begin, end = np.array([0, PS // 2]), np.array([2 * PS, PS])
    assert scene.lux_seconds(2, begin, end)[:, 0] == pytest.approx([5.0, 1.25])
    assert scene.lux_seconds(0, begin[:1], end[:1])[0] == pytest.approx(
        light.integral(0, 2 * PS)[0]
    )


def test_a_course_out_of_order_is_refused() -> None:
    for knots in ((), ((1, 1.0), (0, 1.0)), ((0, -1.0),), ((0, float("inf")),)):
        with pytest.raises(ValueError, match="course"):
            Course(knots)
