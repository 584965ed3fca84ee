"""How an analytic scene becomes light."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import PS, Block, Clock
from cosim.light.source import truth_at
from cosim.stage import blocks
from scenarios.scenes.charts.star import Star
from scenarios.scenes.drawing.analytic import AnalyticSource, spread_points
from scenarios.scenes.drawing.sized import SizedSource

CLOCK = Clock(40_000)
LUX = 500.0


class Slide:
    """A grey ramp that slides to the right: reflectance (column - speed x t) / width, held in
    [0, 1]; only columns 4 to 28 of 32 are seen to move."""

    shape = (6, 32)

    def __init__(self, speed: float) -> None:
        self._speed = speed

    def reflectance(self, t: float) -> np.ndarray:
        column = np.clip((np.arange(32) - self._speed * t) / 32, 0, 1).astype(np.float32)
        column[:4], column[28:] = 0.5, 0.5
        return np.tile(column, (6, 1))

    def speed(self) -> float:
        return self._speed

    def moving(self, start: float, stop: float) -> tuple[int, int, int, int]:
        return (0, 6, 4, 28)

    def points(self) -> list[tuple[int, int, str]]:
        return [(3, 16, "middle")]


@pytest.mark.parametrize("scene", [Slide(2_000.0), Star((40, 50))])
def test_the_truth_at_pixels_is_that_of_the_picture(scene) -> None:
    drawn = AnalyticSource(scene, LUX, CLOCK)
    for source in (drawn, SizedSource(drawn, (90, 70))):
        points = spread_points(source.shape)
        for ps in (0, 10**9 + 7):
            plane = source.truth(ps)
            assert truth_at(source, ps, points) == [plane[y, x] for y, x, _ in points]


@pytest.mark.parametrize("speed", [0.0, 1.0, 2_000.0, 30_000.0, 10**6])
def test_an_analytic_scene_is_true_at_its_knots_and_linear_in_between(speed):
    source = AnalyticSource(Slide(speed), LUX, CLOCK)
    light = source.step(None, Block(0, 256))
    for piece in light.pieces:
        if piece.constant:
            assert speed == 0
            continue
        for ps in (piece.start, piece.stop - 1):
            np.testing.assert_allclose(light.at(ps), LUX * source.truth(ps), atol=LUX * 1e-6)
        # A ramp that slides is linear in time, so the light must follow it wherever it is not
        # held at black or white.
        middle = (piece.start + piece.stop) // 2
        if speed * piece.stop / PS < 4:
            np.testing.assert_allclose(
                light.at(middle), LUX * source.truth(middle), atol=LUX * 1e-6
            )


@pytest.mark.parametrize("speed", [1.0, 2_000.0, 30_000.0, 10**6])
def test_an_edge_moves_at_most_a_pixel_between_knots_unless_a_cycle_is_longer(speed):
    source = AnalyticSource(Slide(speed), LUX, CLOCK)
    for piece in source.step(None, Block(0, 256)).pieces:
        cycles = CLOCK.cycle_at(piece.stop) - CLOCK.cycle_at(piece.start)
        assert CLOCK.edge(CLOCK.cycle_at(piece.start)) == piece.start
        assert cycles == 1 or speed * cycles / CLOCK.hz <= 1


@settings(max_examples=30)
@given(st.integers(1, 300), st.integers(0, 299))
def test_an_analytic_scene_does_not_depend_on_how_the_run_is_split(size, start):
    whole = AnalyticSource(Slide(2_000.0), LUX, CLOCK).step(None, Block(0, 300))
    source = AnalyticSource(Slide(2_000.0), LUX, CLOCK)
    for block in blocks(300, size, start):
        light = source.step(None, block)
        for cycle in (block.start, block.stop - 1):
            ps = CLOCK.middle(cycle)
            np.testing.assert_array_equal(light.at(ps), whole.at(ps))


def test_one_piece_serves_every_block_that_it_touches():
    source = AnalyticSource(Slide(10.0), LUX, CLOCK)
    first = source.step(None, Block(0, 32)).pieces[-1]
    assert source.step(None, Block(32, 16)).pieces[0] is first
    still = AnalyticSource(Slide(0.0), LUX, CLOCK)
    assert still.step(None, Block(0, 1)).pieces[0] is still.step(None, Block(9999, 1)).pieces[0]
    assert still.notes == ["static analytic scene"]


@pytest.mark.parametrize("shape", [(1, 1), (250, 400), (1000, 1000), (3, 2000)])
def test_spread_points_lie_on_the_plane_and_name_themselves(shape):
    points = spread_points(shape)
    assert len(points) == 10
    for row, column, name in points:
        assert 0 <= row < shape[0] and 0 <= column < shape[1]
        assert name == f"row {row}, column {column}"
