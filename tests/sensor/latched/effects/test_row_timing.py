"""Noise of the sampling instants of a band of rows, and the drift that all pixels share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from cosim import PS, Block, Clock, Light, Piece, Summary
from cosim.compute.opencl import Device
from cosim.light.light import Scaled
from cosim.spikes.viform import unpack_planes
from sensor import CHIPS, CameraSetting, SpikeCamera
from sensor.latched.effects import RESIDUAL
from sensor.latched.effects.drift import COMMON_DRIFT, KNOT, STEP, Drift
from sensor.latched.effects.initial_charge import INITIAL_CHARGE
from sensor.latched.effects.row_timing import ROW_TIMING
from sensor.latched.exposure import Exposure
from sensor.latched.sampling import LIMIT, RowTiming
from sensor.latched.tiers import tier_pixels
from tests.sensor.latched.piecewise import charges, level, light_between

CLOCK = Clock(40_000)
PERIOD = PS // 40_000
SHAPE = (40, 60)
ROWS = np.arange(SHAPE[0])
NUMBERS = np.arange(SHAPE[0] * SHAPE[1], dtype=np.uint32)


def camera(**sizes: object) -> CameraSetting:
    chip = replace(CHIPS["spikeone"], height=SHAPE[0], width=SHAPE[1])
    return CameraSetting(chip, CLOCK, 1e5, 3, effects=(RESIDUAL, INITIAL_CHARGE), **sizes)


def steady(made: CameraSetting, rates: np.ndarray) -> Light:
    lux = np.broadcast_to(rates / made.rate(1.0), SHAPE).astype(np.float32)
    return Light((Piece(-PS, PS, lux, lux),))


def test_instants_have_the_stated_noise_in_the_band_and_none_outside() -> None:
    noise = RowTiming(0.08, 0.008, 0.5, 10.0)
    timing = noise.on(NUMBERS, ROWS, SHAPE[0], 9)
    assert timing is not None
    moves = np.array([timing.at(n) for n in range(16, 1616)])
    rows = ROWS[timing.first : timing.stop]
    profile = noise.profile(rows, SHAPE[0])
    assert (
        noise.profile(ROWS, SHAPE[0]).max() > 0.98 and (noise.profile(ROWS, 40) > 0.5).sum() == 10
    )
    assert np.all(np.abs(moves) <= LIMIT + 1e-6)
    mid = profile > 0.9
    middle = moves[:, mid] / profile[mid][:, None]
    knots = middle[::16]
    assert knots.std() == pytest.approx(np.hypot(0.08, noise.slow), rel=0.03)
    # Within 16 cycles the slow part is a line, whose slope is `wander`: the mean difference over 8
    # cycles has its variance, and that of two independent parts.
    change = (middle[8::16] - knots) / 8
    expected = np.hypot(0.008, 0.08 * 2**0.5 / 8)
    assert change.std() == pytest.approx(expected, rel=0.03)
    # Pixels are independent of each other: the mean of a row's 60 varies by 1 / 60.
    assert knots.mean(axis=2).var() == pytest.approx(knots.var() / SHAPE[1], rel=0.15)
    pairs = [
        np.corrcoef(knots[..., n:].ravel(), knots[..., :-n].ravel())[0, 1] for n in (1, 16, 20)
    ]
    assert np.abs(pairs).max() < 4 / np.sqrt(knots.size)
    # Any order of calls, and a plane of other rows, give the same.
    again = noise.on(NUMBERS[12 * SHAPE[1] : 30 * SHAPE[1]], ROWS[12:30], SHAPE[0], 9)
    assert again is not None
    here = slice(12 + again.first - timing.first, 12 + again.stop - timing.first)
    for edge in (900, 17, 16, 33):
        np.testing.assert_array_equal(again.at(edge), moves[edge - 16][here])
    assert (timing.at(0) == 0).all() and (timing.at(-5) == 0).all()
    assert noise.on(NUMBERS[: 5 * SHAPE[1]], ROWS[:5], SHAPE[0], 9) is None


def test_a_move_is_normal_and_keeps_its_law_from_draw_to_draw() -> None:
    """The distribution function of a move is that of a normal law within .0007 at the middle of its
    steps of .0027; the moves of a pixel are independent of each other."""
    numbers = np.arange(3 * 2000, dtype=np.uint32)
    timing = RowTiming(0.1, 0.0, 0.5, 1.5).on(numbers, np.arange(3), 3, 4)
    assert timing is not None
    middle = int(np.argmax(timing.factors[:, 0]))
    moves = np.array([timing.at(edge)[middle] for edge in range(1, 1001)]) / 0.1
    count = moves.size
    assert stats.kstest(moves.ravel(), "norm").statistic < 0.0007 + 0.0014 + 1.5 / np.sqrt(count)
    assert moves.var() == pytest.approx(1, abs=4 * (2 / count) ** 0.5)
    assert stats.kurtosis(moves.ravel()) == pytest.approx(-0.058, abs=4 * (24 / count) ** 0.5)
    for values in (moves, moves**2 - 1):
        for lag in (1, 2, 16):
            assert abs((values[lag:] * values[:-lag]).mean()) < 4 * values.var() / count**0.5


@pytest.mark.parametrize("seed", range(3))
def test_each_pixel_is_compared_with_the_light_up_to_its_instant(seed: int) -> None:
    """The charge by which a comparison is early is the light between edge and instant, taken as
    that of the cycle; the charge that is kept is that of whole cycles."""
    light = light_between((40, 4), [-PERIOD, 17 * PERIOD // 2, 41 * PERIOD], True)
    numbers = np.arange(160, dtype=np.uint32)
    timing = RowTiming(0.1, 0.01, 0.5, 12.0).on(numbers, ROWS, 40, seed)
    assert timing is not None
    spans = Exposure(CLOCK, 3e5, timing=timing).spans(light, 0, 39)
    plain = charges(Exposure(CLOCK, 3e5), light, 0, 39)
    assert [span.first for span in spans] == list(range(39))
    for span in spans:
        np.testing.assert_array_equal(span.charge, plain[span.first])
        moved = np.zeros((40, 4))
        moved[timing.first : timing.stop] = timing.at(span.first + 1)
        assert span.advance is not None
        expected = span.charge.reshape(40, 4) * moved
        np.testing.assert_allclose(span.advance.reshape(40, 4), expected, rtol=1e-6, atol=1)


@pytest.mark.parametrize("tier", ["exact", "fast", "reference"])
def test_intervals_vary_and_do_not_accumulate(device: Device, tier: str) -> None:
    """About each pixel's mean, an interval's variance exceeds the rounding's by 2 s^2 (means of all
    phases); sums of seven intervals exceed it by the same."""
    noise = RowTiming(0.084, 0.0, 0.5, 400.0)  # b = 0.99 and more in all rows
    made = camera(row_timing=noise)
    rates = 1 / np.linspace(3, 5, SHAPE[1], endpoint=False)  # all phases alike
    used = device if tier == "fast" else None
    chip = SpikeCamera(made, used, tier=tier)  # type: ignore[arg-type]
    words = chip.step(steady(made, rates), Block(0, 1000)).words
    planes = unpack_planes(words, 0, 1000).reshape(1000, -1)
    excess: dict[int, list[float]] = {1: [], 7: []}
    for pixel in range(planes.shape[1]):
        at = np.flatnonzero(planes[:, pixel])
        for together, found in excess.items():
            gaps = at[together:] - at[:-together]
            part = gaps.mean() % 1
            found.append(gaps.var() - part * (1 - part))
    for together, found in excess.items():
        assert np.mean(found) == pytest.approx(2 * 0.084**2, rel=0.1), together


@pytest.mark.parametrize("tier", ["exact", "fast", "reference"])
def test_pixels_of_a_row_have_noise_of_their_own(device: Device, tier: str) -> None:
    """As in the band of a recorded chip: counts of a row vary as those of independent pixels (1.01
    to 1.04 times), and pixels 20 columns apart have nothing in common (.0004)."""
    noise = RowTiming(0.084, 0.008, 0.5, 400.0)
    made = camera(row_timing=noise)
    light = steady(made, 1 / np.linspace(3, 5, SHAPE[1], endpoint=False))
    used = device if tier == "fast" else None
    words = SpikeCamera(made, used, tier=tier).step(light, Block(0, 960)).words  # type: ignore[arg-type]
    counts = unpack_planes(words, 0, 960).reshape(-1, 16, *SHAPE).sum(axis=1).astype(float)
    off = counts - counts.mean(axis=0)
    alone = off.var(axis=0).sum(axis=1).mean()
    assert off.sum(axis=2).var(axis=0).mean() / alone == pytest.approx(1, abs=0.12)
    apart = (off[..., 20:] * off[..., :-20]).mean() / off.var(axis=0).mean()
    assert abs(apart) < 0.02


def test_a_chip_without_the_band_has_the_bits_of_one_without_noise() -> None:
    made = camera(row_timing=RowTiming(0.1, 0.01, 0.0, 5.0))
    light = steady(made, np.linspace(0.1, 0.9, SHAPE[1]))
    noisy, plain = (
        SpikeCamera(s, None).step(light, Block(0, 100)).words
        for s in (made, made.without(["row timing noise"]))
    )
    assert (noisy[:, 5:] == plain[:, 5:]).all() and (noisy[:, :5] != plain[:, :5]).any()


def test_bounds_hold_what_leaving_the_effects_out_changes() -> None:
    window, cycles = 41, 2000
    rates = np.linspace(0.2, 0.6, SHAPE[1])
    for effect, sizes in (
        (ROW_TIMING, {"row_timing": RowTiming(0.084, 0.008, 0.5, 400.0)}),
        (COMMON_DRIFT, {"drift": 1e-3}),
    ):
        made = camera(**sizes)
        counts = [
            unpack_planes(
                SpikeCamera(s, None).step(steady(s, rates), Block(0, cycles)).words, 0, cycles
            )
            .reshape(cycles, -1)[: cycles // window * window]
            .reshape(-1, window, SHAPE[0] * SHAPE[1])
            .sum(axis=1)
            .astype(float)
            for s in (made, made.without([effect.name]))
        ]
        # Counts of whole spikes differ more than rates with their fractions, so means over windows.
        change = np.abs(counts[0].mean(axis=0) / counts[1].mean(axis=0) - 1)
        q = made.threshold
        scene = Summary(
            0.2 * q, 0.6 * q, q, window, cycles, timing=np.hypot(0.084, 0.0905), planes=0.0
        )
        bound = effect.bound(made, scene)
        assert np.sqrt((change**2).mean()) < bound.value < 0.05


def test_drift_is_one_gain_of_all_pixels_in_steps() -> None:
    drift = Drift(CLOCK, 1e-2, 4)
    gains = np.array([drift.gain(n) for n in range(40 * KNOT // STEP)])
    knots = gains[:: KNOT // STEP]
    assert knots.std() == pytest.approx(1e-2, rel=0.35) and abs(knots.mean() - 1) < 5e-3
    # Linear between knots.
    middle = gains[2 :: KNOT // STEP][: len(knots) - 1]
    np.testing.assert_allclose(middle, (knots[:-1] + knots[1:]) / 2, rtol=1e-9)
    light = light_between(SHAPE, [0, 100 * PERIOD, 300 * PERIOD], True)
    drifted = drift.on(light, 0, 298)
    for cycle in (0, 15, 16, 90, 143, 144, 200, 290):
        at = CLOCK.middle(cycle)
        expected = light.at(at) * drift.gain(drift.step(cycle))
        np.testing.assert_allclose(drifted.at(at), expected, rtol=1e-5)
    # The same objects in the next call, so that what is prepared from them stays.
    again = drift.on(light, 64, 100)
    assert set(map(id, again.pieces)) <= set(map(id, drifted.pieces))
    plane = level(SHAPE, 3)
    still = Light((Piece(-PS, PS, plane, plane),))
    assert all(piece.constant for piece in drift.on(still, 0, 500).pieces)


def test_a_late_row_with_noise_finds_its_light() -> None:
    """The last row is sampled almost a cycle late, and up to 0.45 cycles later."""
    made = camera(row_timing=RowTiming(0.1, 0.01, 1.0, 20.0), row_skew=1.0)
    before, after = made.reach
    lux = np.full(SHAPE, 0.4 / made.rate(1.0), np.float32)
    for start in range(0, 640, 64):
        piece = Piece(CLOCK.edge(start - before), CLOCK.edge(start + 64 + after), lux, lux)
        chip = SpikeCamera(made, None)
        assert chip.step(Light((piece,)), Block(start, 64)).words.any()


def test_pixels_that_multiply_planes_have_the_same_light(device: Device) -> None:
    """Steps of the drift at 16 and every 128 cycles, within ramps and at their ends."""
    rng, setting = np.random.default_rng(2), camera(drift=1e-2)
    top = 0.7 / setting.rate(1.0)
    planes = [rng.uniform(0, top, SHAPE).astype(np.float32) for _ in range(6)]
    edges = [0, 100, 144, 272, 300, 420]
    light = Light(tuple(
        Piece(CLOCK.edge(a), CLOCK.edge(b), one, two)
        for a, b, one, two in zip(edges, edges[1:], planes, planes[1:], strict=False)
    ))  # fmt: skip
    arrays, products = (
        Drift(CLOCK, 1e-2, 4).on(light, 0, 400, products=each) for each in (False, True)
    )
    assert any(isinstance(piece.first, Scaled) for piece in products.pieces)
    for one, two in zip(arrays.pieces, products.pieces, strict=True):
        assert (one.start, one.stop, one.constant) == (two.start, two.stop, two.constant)
        np.testing.assert_array_equal(one.first, np.asarray(two.first))
        np.testing.assert_array_equal(one.last, np.asarray(two.last))
    numbers = np.arange(ROWS.size * SHAPE[1], dtype=np.uint32)
    one, two = (
        tier_pixels("fast", setting, SHAPE, numbers, ROWS, device).expose(each, 0, 400)
        for each in (arrays, products)
    )
    np.testing.assert_array_equal(one, two)
    assert 0.2 < np.bitwise_count(one).sum() / (400 * numbers.size) < 0.5


def test_drift_reaches_rows_whose_light_comes_many_cycles_late() -> None:
    """As that of a slow panel with a rolling scan: the last row has light of 200 cycles before."""
    made = camera(drift=5e-3)
    delay = np.arange(SHAPE[0]) * (200 * PERIOD // SHAPE[0])
    chip = SpikeCamera(made, None, row_delay=delay)
    for start in range(0, 384, 64):
        assert chip.step(steady(made, 0.4), Block(start, 64)).words.any()


def test_counts_of_all_pixels_follow_the_drift(device: Device) -> None:
    made = camera(drift=5e-3)
    light = steady(made, np.linspace(0.2, 0.9, SHAPE[1]))
    chip = SpikeCamera(made, device, tier="fast")
    planes = np.concatenate(
        [unpack_planes(chip.step(light, Block(n, 100)).words, 0, 100) for n in range(0, 1200, 100)]
    )
    counts = planes.reshape(1200, -1).sum(axis=1)
    drift = Drift(CLOCK, 5e-3, 3)
    expected = np.array([drift.gain(drift.step(n)) for n in range(1200)])
    windows = counts[: 9 * STEP].reshape(9, STEP).mean(axis=1)
    gains = expected[: 9 * STEP].reshape(9, STEP).mean(axis=1)
    found = windows / np.mean(windows / gains)
    np.testing.assert_allclose(found, gains, atol=2e-4)
