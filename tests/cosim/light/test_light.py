"""Light: its integral in closed form, jumps, and relays, which map each level once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import PS, Light, Piece
from cosim.light.light import PlaneMap

EPS = float(np.finfo(np.float32).eps)
LEAST = float(np.finfo(np.float32).smallest_normal)  # below it libraries may flush to 0


def plane(level: float, shape: tuple[int, int] = (2, 3)) -> np.ndarray:
    """A plane in which each pixel has `level` times 1 + its number."""
    return (level * (1 + np.arange(shape[0] * shape[1])).reshape(shape)).astype(np.float32)


ONE = plane(1).astype(np.float64)
A, B, C = plane(1), plane(5), plane(2)
# Constant, a ramp that begins with a jump, a ramp that goes on from it.
LIGHT = Light((Piece(0, 100, A, A), Piece(100, 300, B, C), Piece(300, 400, C, A)))


def test_at_a_jump_the_later_piece_counts() -> None:
    np.testing.assert_array_equal(LIGHT.at(99), A)
    np.testing.assert_array_equal(LIGHT.at(100), B)
    np.testing.assert_array_equal(LIGHT.at(200), (B + C) / 2)
    np.testing.assert_array_equal(LIGHT.at(300), C)


@pytest.mark.parametrize("ps", [-1, 400])
def test_an_instant_outside_is_refused(ps: int) -> None:
    with pytest.raises(ValueError, match=f"instant must be from 0 to before 400 ps, not {ps} ps"):
        LIGHT.at(ps)


def test_integral_of_a_ramp_is_that_worked_by_hand() -> None:
    # From 150 to 250 ps the mean of the ramp is half way between 5 and 2.
    np.testing.assert_allclose(LIGHT.integral(150, 250), ONE * 3.5 * 100 / PS, rtol=1e-15)
    # 50 ps of 1, then the first quarter of the ramp: 5 to 4.25.
    np.testing.assert_allclose(
        LIGHT.integral(50, 150), ONE * (1 * 50 + 4.625 * 50) / PS, rtol=1e-15
    )
    assert not LIGHT.integral(120, 120).any()


@st.composite
def lights(draw: st.DrawFn) -> Light:
    """Up to six pieces between whole microseconds: constant, continuous or with jumps."""
    knots = sorted(draw(st.sets(st.integers(0, 1000), min_size=2, max_size=7)))
    levels = st.floats(0, 1e4, width=32)
    made: list[Piece] = []
    for start, stop in pairwise(knots):
        joined = made and draw(st.booleans())
        first = made[-1].last if joined else plane(draw(levels))
        last = first if draw(st.booleans()) else plane(draw(levels))
        made.append(Piece(start * 10**6, stop * 10**6, first, last))
    return Light(tuple(made))


@given(lights(), st.data())
def test_integral_is_the_numeric_quadrature(light: Light, data: st.DataObject) -> None:
    begin, end = light.pieces[0].start, light.pieces[-1].stop
    start = data.draw(st.integers(begin, end))
    stop = data.draw(st.integers(start, end))
    # The midpoint rule is exact on every stretch without a knot.
    knots = sorted({start, stop} | {p.start for p in light.pieces if start < p.start < stop})
    total, highest = np.zeros(light.shape), np.zeros(light.shape)
    for a, b in pairwise(knots):
        for i in range(8):
            middle = a + (2 * i + 1) * (b - a) // 16
            level = light.at(middle).astype(float)
            total += level * (b - a) / 8 / PS
            highest = np.maximum(highest, level)
    # at() rounds its level and its share of the piece to float32, the middle to a picosecond,
    # which in a piece of a microsecond or more moves the level by at most a millionth.
    steepest = max(float(np.abs(p.last - p.first).max()) for p in light.pieces)
    largest = max(float(p.first.max()) for p in light.pieces)
    allowed = 8 * EPS * (largest + steepest) + 1e-6 * steepest + LEAST
    allowed *= (stop - start) / PS
    np.testing.assert_allclose(light.integral(start, stop), total, rtol=0, atol=allowed + 1e-300)


@given(lights(), st.data())
def test_integrals_add_up(light: Light, data: st.DataObject) -> None:
    cuts = st.integers(light.pieces[0].start, light.pieces[-1].stop)
    a, b, c = sorted(data.draw(st.tuples(cuts, cuts, cuts)))
    # A dozen roundings of levels below 1e5, in float64.
    allowed = 12 * float(np.finfo(float).eps) * 1e5 * (c - a) / PS
    parts = light.integral(a, b) + light.integral(b, c)
    np.testing.assert_allclose(parts, light.integral(a, c), rtol=0, atol=allowed)


@pytest.mark.parametrize(("start", "stop"), [(-1, 10), (390, 401), (20, 10)])
def test_an_integral_over_time_without_light_is_refused(start: int, stop: int) -> None:
    with pytest.raises(ValueError, match=f"light must cover {start} to {stop} ps, not 0 to 400 ps"):
        LIGHT.integral(start, stop)


def test_gaps_and_overlaps_are_refused() -> None:
    for start in (99, 101):
        with pytest.raises(ValueError, match=f"pieces must join at 100 ps, not {start} ps"):
            Light((Piece(0, 100, A, A), Piece(start, 200, A, A)))


def test_light_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="light must hold at least one piece, not none"):
        Light(())
    with pytest.raises(ValueError, match="a piece must end after its start 5, not at 5"):
        Piece(5, 5, A, A)
    with pytest.raises(ValueError, match=r"levels must share one .*, not \(2, 3\), \(3, 2\)"):
        Piece(0, 5, A, plane(1, (3, 2)))
    with pytest.raises(ValueError, match=r"pieces must share one .*, not \(2, 3\), \(3, 2\)"):
        other = plane(1, (3, 2))
        Light((Piece(0, 5, A, A), Piece(5, 6, other, other)))


class Counted:
    """Doubles planes and counts its calls."""

    def __init__(self) -> None:
        self.calls: list[np.ndarray] = []

    def __call__(self, given: np.ndarray) -> np.ndarray:
        self.calls.append(given)
        return given * np.float32(2)


def test_a_relay_maps_each_level_and_piece_once_over_all_blocks() -> None:
    double = Counted()
    relay = PlaneMap(double)
    planes = [plane(n) for n in range(40)]
    pieces = [Piece(n, n + 1, planes[n], planes[n + 1]) for n in range(39)]
    images: dict[int, Piece] = {}
    for first in range(0, 36, 2):  # blocks of four pieces, two of them known from the block before
        for n, image in enumerate(relay(Light(tuple(pieces[first : first + 4]))).pieces, first):
            assert images.setdefault(n, image) is image
            np.testing.assert_array_equal(image.first, 2 * planes[n])
            np.testing.assert_array_equal(image.last, 2 * planes[n + 1])
            assert (image.start, image.stop) == (n, n + 1)
    assert [int(p[0, 0]) for p in double.calls] == list(range(39))
    for n in range(37):
        assert images[n].last is images[n + 1].first


def test_a_relay_keeps_constants_constant() -> None:
    double = Counted()
    relay = PlaneMap(double)
    first = relay(Light((Piece(0, 10, A, A),), "lux"))
    again = relay(Light((Piece(10, 20, A, A), Piece(20, 30, A, B))))
    assert all(p.constant for p in (*first.pieces, again.pieces[0]))
    assert again.pieces[0].first is first.pieces[0].first
    assert again.pieces[1].first is first.pieces[0].first
    assert not again.pieces[1].constant
    assert len(double.calls) == 2


def test_a_relay_forgets_the_pieces_of_old_blocks() -> None:
    double = Counted()
    relay = PlaneMap(double)
    for n in range(300):
        level = plane(n)
        relay(Light((Piece(n, n + 1, level, level),)))
    assert len(relay._pieces) == 1
    assert len(relay._planes) == 4


@pytest.mark.parametrize(
    ("grow", "box", "grown"),
    [
        (0, (2, 4, 3, 5), (2, 4, 3, 5)),
        (1, (2, 4, 3, 5), (1, 5, 2, 6)),
        (3, (2, 4, 3, 5), (0, 7, 0, 8)),
        (99, (2, 4, 3, 5), (0, 8, 0, 9)),
        (None, (2, 4, 3, 5), None),
        (2, None, None),
    ],
)
def test_a_changed_box_grows_by_the_relays_reach(grow, box, grown) -> None:
    one, two = plane(1, (8, 9)), plane(2, (8, 9))
    (image,) = PlaneMap(Counted(), grow)(Light((Piece(0, 1, one, two, box),))).pieces
    assert image.changed == grown
