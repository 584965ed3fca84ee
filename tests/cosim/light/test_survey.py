"""The survey of a scene's light: its range, and how far it changes within a cycle."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import PS, Block, Clock, Light, Piece
from cosim.light.survey import Survey, survey, through
from cosim.light.survey_compiled import most_of_tiles

CLOCK = Clock.from_hz(40e3)
CYCLE = PS // 40_000
A, B, C = (np.array([[low, 7, high]], np.float32) for low, high in ((2, 4), (10, 4), (6, 5)))
RAMPS = (Piece(0, 10 * CYCLE, A, B), Piece(10 * CYCLE, 30 * CYCLE, B, C))


class Pieces:
    """A source of given pieces."""

    def __init__(self, *pieces: Piece) -> None:
        self._light = Light(pieces)

    def step(self, data: None, block: Block) -> Light:
        return self._light


def surveyed(*pieces: Piece) -> Survey:
    return survey(Pieces(*pieces), CLOCK, 20)  # type: ignore[arg-type]


def test_the_range_and_the_slope_of_ramps() -> None:
    found = surveyed(*RAMPS)
    assert found.least.tolist() == [[2, 7, 4]] and found.most.tolist() == [[10, 7, 5]]
    np.testing.assert_allclose(found.slope, [[0.8, 0, 1 / 20]], rtol=1e-6)
    assert found.steady.tolist() == [[False, True, False]]
    assert found.moved is not None and found.moved.tolist() == [[12, 0, 1]]
    doubled = through(found, lambda light: Light(tuple(
        Piece(p.start, p.stop, 2 * p.first, 2 * p.last) for p in light.pieces
    )))  # fmt: skip
    np.testing.assert_allclose(doubled.slope, 2 * np.asarray(found.slope))


@pytest.mark.parametrize(
    "pieces",
    [
        (RAMPS[0], Piece(10 * CYCLE, 30 * CYCLE, C, C)),  # a jump
        (Piece(0, CYCLE // 2, A, B), Piece(CYCLE // 2, 30 * CYCLE, B, B)),  # within a cycle
    ],
    ids=["jump", "short"],
)
def test_where_light_may_jump_the_slope_is_the_whole_range(pieces: tuple[Piece, ...]) -> None:
    found = surveyed(*pieces)
    whole = found.most - found.least
    assert np.asarray(found.slope)[0, 0] == whole[0, 0] > 0
    assert np.asarray(found.slope)[0, 1] == 0


@pytest.mark.parametrize("reach", [0, 1])
def test_the_most_of_a_tile_and_of_the_pixels_around_it(reach: int) -> None:
    plane = np.random.default_rng(3).normal(size=(37, 50)).astype(np.float32)
    out = np.empty((3, 4), np.float32)
    most_of_tiles(plane, 16, reach, out)
    for row, column in np.ndindex(out.shape):
        y, x = 16 * row, 16 * column
        near = plane[max(y - reach, 0) : y + 16 + reach, max(x - reach, 0) : x + 16 + reach]
        assert out[row, column] == near.max()
