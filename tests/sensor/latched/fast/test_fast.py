"""The fast tier: kernels against numpy bit for bit, and both against the exact tier."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim import PS, Clock, Light, Piece
from cosim.compute.opencl import Device
from sensor.device.pattern import DevicePattern
from sensor.latched.effects import EFFECTS, RESIDUAL
from sensor.latched.exposure import Exposure
from sensor.latched.fast import FastPixels, PixelArray
from sensor.latched.fast.bound import rate_bound
from sensor.latched.fast.units import (
    BANK,
    DEAD_TIME,
    NOISE,
    current_thresholds,
    first_charge,
    quantile,
    units_of,
)
from sensor.latched.pixel.charge import LARGEST
from sensor.latched.pixel.interval import threshold
from sensor.latched.pixel.model import ExactModel, Reset
from sensor.latched.pixel.numpy_form import NumpyPixels
from sensor.latched.sampling import RowTiming, row_offsets
from tests.sensor.latched.fast.numpy_fast import NumpyFast
from tests.sensor.latched.piecewise import level, light_between

CLOCK = Clock(40_000)
PERIOD = PS // 40_000
ALL = tuple(EFFECTS.values())
SHAPE = (7, 45)  # no whole number of groups, nor of words in what follows
N = SHAPE[0] * SHAPE[1]
NUMBERS = np.random.default_rng(5).integers(0, 2**32, N, dtype=np.uint32)


def bits(words: npt.NDArray[np.uint32], cycles: int) -> npt.NDArray[np.uint8]:
    """(cycles, n) of 0 and 1."""
    flat = np.unpackbits(words.T.copy().view(np.uint8), axis=1, bitorder="little")
    return flat[:, :cycles].T


def run(pixels: Any, light: Light, cuts: list[int]) -> npt.NDArray[np.uint8]:
    """Bits of a run in several calls."""
    return np.concatenate(
        [bits(pixels.expose(light, a, b - a), b - a) for a, b in itertools.pairwise(cuts)]
    )


def test_first_charge_is_each_pixels_own_however_many_there_are() -> None:
    model = ExactModel(300.0, 4, ALL)
    units, random = units_of(model), np.random.default_rng(8)
    numbers = random.integers(0, 2**32, 20_000, dtype=np.uint32)  # more than are drawn at a time
    flags = random.integers(0, 8, numbers.size, dtype=np.uint8)
    whole = first_charge(model, units, numbers, flags)
    for part in (slice(0, 500), slice(16_300, 16_500)):
        alone = first_charge(model, units, numbers[part], flags[part])
        np.testing.assert_array_equal(whole[part], alone)
    for kind in range(8):  # of one kind alone
        alike = first_charge(model, units, numbers, np.full(numbers.size, kind, np.uint8))
        np.testing.assert_array_equal(whole[flags == kind], alike[flags == kind])


def cut_out(light: Light, place: Any) -> Light:
    """Light on a part of the plane, an index of numpy; equal planes stay one array."""
    known = {
        id(p): np.ascontiguousarray(p[place])
        for piece in light.pieces
        for p in (piece.first, piece.last)
    }
    return Light(
        tuple(Piece(p.start, p.stop, known[id(p.first)], known[id(p.last)]) for p in light.pieces)
    )


def boxed(seed: int, peak: float, count: int) -> Light:
    """Pieces of random length: each changes a box, jumps, or is constant."""
    random = np.random.default_rng(seed)
    plane = level(SHAPE, seed, peak)
    made, at = [], 0
    for n in range(count):
        stop = at + int(random.choice([PERIOD // 7, PERIOD, 3 * PERIOD + 11, 9 * PERIOD]))
        y0, x0 = random.integers(0, SHAPE[0]), random.integers(0, SHAPE[1])
        box = (int(y0), int(random.integers(y0, SHAPE[0])) + 1, int(x0), min(int(x0) + 9, 45))
        last = plane
        if random.random() < 0.7:
            last = plane.copy()
            inside = slice(*box[:2]), slice(*box[2:])
            last[inside] = level(SHAPE, seed + n + 1, peak)[inside]
        made.append(Piece(at, stop, plane, last, box))
        at, plane = stop, last
    return Light((*made, Piece(at, 200 * PERIOD, plane, plane)))


CASES = list(itertools.product([1.0, 30.0, 1000.0, 2e6], [0.0, 0.3, 1.0]))
RULES = [("residual", *case) for case in CASES]
RULES += [(rule, *CASES[n]) for rule in ("hard", "subtract") for n in (1, 6, 9)]


@pytest.mark.parametrize(("reset", "electrons", "dead"), RULES)
def test_kernels_agree_with_plain_numpy_on_every_bit(
    device: Device, reset: Reset, electrons: float, dead: float
) -> None:
    # All sets of flags in one plane; light from dark to 1.7 thresholds a cycle; row offsets.
    seed = CASES.index((electrons, dead))
    random = np.random.default_rng(seed)
    noise = min(electrons / 20, 500.0) if seed % 2 else 0.0
    model = ExactModel(electrons, 7, ALL, threshold_noise=noise, dead_time=dead, reset=reset)
    pattern = DevicePattern(
        prnu=0.1, dark=electrons, dsnu=0.2, threshold_fpn=0.02,
        hot=0.05, hot_current=electrons * 4e4, dead=0.05, device_seed=3,
    ).at(NUMBERS)  # fmt: skip
    offsets = row_offsets(CLOCK, 7, 0.8, 10e-6, (0, 7)) if seed % 3 else None
    array = PixelArray(
        model, SHAPE, NUMBERS, CLOCK, electrons * 40_000 * 1.7 / 700,
        pattern if seed % 2 else None, offsets,
        random.choice([0, 1, 2, 3, 17, 19], (7, 3)).astype(np.uint8),
        timing=RowTiming(0.1, 0.01, 0.5, 2.0).on(NUMBERS, np.arange(7), 7, seed)
        if seed % 5 > 1
        else None,
    )  # fmt: skip
    fast, plain = FastPixels(array, device), NumpyFast(array)
    knots = [0, 3 * PERIOD + 5, 9 * PERIOD, 9 * PERIOD + PERIOD // 3, 20 * PERIOD, 200 * PERIOD]
    light = light_between(SHAPE, knots, True) if seed % 2 else boxed(seed, 700.0, 25)
    found = run(fast, light, [0, 5, 37, 64, 130, 171])
    expected = run(plain, light, [0, 171])
    assert 0.02 < expected.mean() < 0.98
    assert np.array_equal(found, expected)
    for key, values in plain.state().items():
        assert np.array_equal(fast.state()[key], values), key
    assert np.array_equal(fast.fraction(), plain.fraction())


def test_cycles_of_very_many_pieces_agree_too(device: Device) -> None:
    knots = [0, *range(PERIOD // 50, 3 * PERIOD, PERIOD // 20), 9 * PERIOD]
    light = light_between(SHAPE, knots, True)
    model = ExactModel(300.0, 1, ALL)
    gain = 300.0 * 40_000 / 1500
    array = PixelArray(model, SHAPE, NUMBERS, CLOCK, gain)
    fast = FastPixels(array, device)
    found = run(fast, light, [0, 1, 9])
    plain = NumpyFast(array)
    assert np.array_equal(found, run(plain, light, [0, 9]))
    exact = NumpyPixels(model, NUMBERS)
    spans = Exposure(CLOCK, gain).spans(light, 0, 9)
    assert np.mean(found != bits(exact.expose(spans, 9), 9)) < 1e-3


def test_a_patch_gives_the_bits_of_the_whole_and_a_restored_run_goes_on(device: Device) -> None:
    light, model = boxed(3, 700.0, 30), ExactModel(200.0, 5, ALL, dead_time=0.1)
    gain = 200.0 * 40_000 / 900
    offsets = row_offsets(CLOCK, 7, 1.0, 0.0, (0, 7))
    whole = FastPixels(PixelArray(model, SHAPE, NUMBERS, CLOCK, gain, None, offsets), device)
    found = run(whole, light, [0, 64])
    kept = whole.state()
    later = run(whole, light, [64, 128])
    rows, columns = [5, 1, 6], np.r_[32:45]  # the last group
    place = np.ix_(rows, columns)
    part = cut_out(light, place)
    numbers = NUMBERS.reshape(SHAPE)[place].ravel()
    array = PixelArray(model, (3, 13), numbers, CLOCK, gain, None, offsets[rows])
    patch = FastPixels(array, device)
    mine = np.arange(N).reshape(SHAPE)[place].ravel()
    assert np.array_equal(run(patch, part, [0, 31, 64]), found[:, mine])
    again = FastPixels(PixelArray(model, SHAPE, NUMBERS, CLOCK, gain, None, offsets), device)
    again.restore(kept)
    assert np.array_equal(run(again, light, [64, 128]), later)
    assert found.any() and later.any()


class TestClosedForms:
    def test_without_noise_the_count_is_the_floor_of_charge_over_q(self, device: Device) -> None:
        # Random light of 24 bits a cycle is exact in float32 and in the phase.
        rates = np.random.default_rng(1).integers(0, 2**24, N) / 2.0**24
        plane = rates.reshape(SHAPE).astype(np.float32)
        model = ExactModel(1000.0, 1, (RESIDUAL,))
        pixels = FastPixels(PixelArray(model, SHAPE, NUMBERS, CLOCK, 1000.0 * 40_000), device)
        light = Light((Piece(0, PS, plane, plane),))
        count = run(pixels, light, [0, 100, 640]).sum(axis=0, dtype=int)
        assert np.array_equal(count, np.floor(rates * 640))
        assert np.allclose(pixels.fraction(), rates * 640 % 1, atol=1e-9)

    @pytest.mark.parametrize("effects", [(RESIDUAL,), ALL], ids=["noiseless", "all"])
    def test_saturated_pixels_fire_in_every_cycle_and_dark_ones_never(
        self, device: Device, effects: tuple[Any, ...]
    ) -> None:
        plane = np.zeros(SHAPE, np.float32)
        plane[:, ::2] = np.geomspace(1.6, 1e9, SHAPE[0])[:, None]
        pixels = FastPixels(
            PixelArray(ExactModel(100.0, 3, effects), SHAPE, NUMBERS, CLOCK, 100.0 * 40_000), device
        )
        for light in (
            Light((Piece(0, PS, plane, plane),)),
            Light((Piece(0, PS, plane, plane * np.float32(1.25)),)),
        ):
            found = run(pixels, light, [0, 100, 131]).reshape(131, *SHAPE)
            assert found[:, :, ::2].all() and not found[:, :, 1::2].any()
            assert (pixels.fraction() >= 0).all() and (pixels.fraction() <= 1).all()

    def test_a_hard_reset_makes_intervals_of_whole_cycles(self, device: Device) -> None:
        rates = np.random.default_rng(2).integers(1, 2**24, N) / 2.0**23
        plane = rates.reshape(SHAPE).astype(np.float32)
        model = ExactModel(1000.0, 1, (), reset="hard")
        dark = np.zeros_like(plane)
        edges = [0, 300 * PERIOD, 302 * PERIOD, PS]
        for middle in (plane, dark):  # light that stands, and light that changes
            levels = [plane, middle, plane]
            spans = zip(itertools.pairwise(edges), levels, strict=True)
            light = Light(tuple(Piece(a, b, p, p) for (a, b), p in spans))
            pixels = FastPixels(PixelArray(model, SHAPE, NUMBERS, CLOCK, 1000.0 * 40_000), device)
            found = run(pixels, light, [0, 100, 640]).sum(axis=0, dtype=int)
            lit = 640 if middle is plane else 638
            assert np.array_equal(found, lit // np.ceil(1 / rates).astype(int))

    def test_subtraction_pays_back_what_piled_up(self, device: Device) -> None:
        plane = np.full(SHAPE, 1.5, np.float32)
        light = Light((
            Piece(0, 40 * PERIOD, plane, plane), Piece(40 * PERIOD, PS, plane * 0, plane * 0),
        ))  # fmt: skip
        model = ExactModel(1000.0, 1, (), reset="subtract")
        pixels = FastPixels(PixelArray(model, SHAPE, NUMBERS, CLOCK, 1000.0 * 40_000), device)
        found = run(pixels, light, [0, 39, 45, 100])
        assert found[:60].all() and not found[60:].any()
        # At most 64 thresholds accumulate.
        bright = Light((Piece(0, 40 * PERIOD, plane * 9, plane * 9), *light.pieces[1:]))
        pixels = FastPixels(PixelArray(model, SHAPE, NUMBERS, CLOCK, 1000.0 * 40_000), device)
        assert (run(pixels, bright, [0, 40, 300]).sum(axis=0, dtype=int) == 40 + 64).all()

    def test_a_tie_fires(self, device: Device) -> None:
        plane = np.full((1, 3), 0.25, np.float32) + np.float32([0, -(2.0**-26), 2.0**-24])
        model = ExactModel(8.0, 1, (RESIDUAL,))
        pixels = FastPixels(PixelArray(model, (1, 3), NUMBERS[:3], CLOCK, 8.0 * 40_000), device)
        found = run(pixels, Light((Piece(0, PS, plane, plane),)), [0, 5])
        assert found.T.tolist() == [[0, 0, 0, 1, 0], [0, 0, 0, 0, 1], [0, 0, 0, 1, 0]]


@pytest.mark.parametrize("electrons", [1.0, 2.5, 100.0, 1000.0, 2e6])
def test_thresholds_are_the_exact_tiers_to_the_error_said(electrons: float) -> None:
    model = ExactModel(electrons, 1, ALL)
    units = units_of(model)
    word = np.random.default_rng(4).integers(0, 2**32, 200_000, dtype=np.uint32)
    word[:70] = np.r_[np.arange(35), 2**32 - 1 - np.arange(35)]
    word[70:134] = np.r_[2 ** np.arange(32), 2**32 - 2 ** np.arange(32)]
    exact = threshold(model.table(), word) / model.q * units.one
    found = quantile(units.table, word)
    assert np.abs(found - exact).max() <= units.error
    assert units.shortest <= found.min() and found.max() <= units.top
    assert units.error * 2.0**-units.bits < 3e-5 / np.sqrt(electrons) + 5e-8
    assert abs(np.mean(found - exact)) < units.error / 4 + 1


def exact_rate(model: ExactModel, exact: NumpyPixels, numbers: Any) -> Any:
    """Stored charge of the exact tier's pixels over their current threshold."""
    state = exact.state()
    current = current_thresholds(model, state.spikes, numbers) if model.noisy else 1.0
    return 1 - (state.deficit + 1) / model.q / current


@pytest.mark.parametrize("seed", range(24))
def test_the_proven_bound_of_the_rate_is_never_exceeded(device: Device, seed: int) -> None:
    random = np.random.default_rng(seed)
    electrons = float(10 ** random.uniform(1.0 if seed % 4 else 0.0, 6.3))
    effects = ALL if seed % 3 else (RESIDUAL,)
    dead = float(random.choice([0.0, 0.0, 0.2]))
    model = ExactModel(electrons, seed, effects, dead_time=dead)
    brightest = 10 ** random.uniform(-2, -0.1) * 0.7
    dimmest = brightest * random.choice([0.01, 0.5, 1.0])
    shape, cycles = (4, 40), 640
    numbers = random.integers(0, 2**32, 160, dtype=np.uint32)
    pattern, dark = None, np.zeros(160)
    if seed % 2:
        pattern = DevicePattern(
            prnu=0.05, dark=electrons, dsnu=0.2, threshold_fpn=0.02, device_seed=seed
        ).at(numbers)
        dark = pattern.dark / 40_000
    gain = electrons * 40_000.0
    factor = 1 if pattern is None else pattern.gain
    planes = [random.uniform(dimmest, brightest, shape).astype(np.float32) for _ in range(4)]
    if dimmest == brightest:
        planes = planes[:1] * 4
    knots = [0, 100 * PERIOD + 7, 300 * PERIOD, 700 * PERIOD]
    light = Light(
        tuple(Piece(a, b, p, q) for (a, b), p, q in zip(
            itertools.pairwise(knots), planes, planes[1:], strict=False))
    )  # fmt: skip
    offsets = row_offsets(CLOCK, 4, 1.0, 5e-6, (0, 4)) if seed % 5 else None
    made = [np.ravel(p) * factor * electrons + dark for p in planes]
    bound = rate_bound(
        model, min(float(m.min()) for m in made), max(float(m.max()) for m in made), cycles
    )
    assert bound.kind == "proof"
    fast = FastPixels(PixelArray(model, shape, numbers, CLOCK, gain, pattern, offsets), device)
    exact = NumpyPixels(model, numbers)
    before = fast.fraction(), exact_rate(model, exact, numbers)
    found = run(fast, light, [0, 64, 640])
    spans = Exposure(CLOCK, gain, pattern, offsets).spans(light, 0, cycles)
    expected = bits(exact.expose(spans, cycles), cycles)
    rates = [
        (b.sum(axis=0) + after - first) / cycles
        for b, after, first in (
            (found, fast.fraction(), before[0]),
            (expected, exact_rate(model, exact, numbers), before[1]),
        )
    ]
    assert expected.any()
    if dead and dimmest != brightest:  # a spike on a cycle's edge may lose another cycle's light
        assert np.mean(found != expected) < 1e-3
    elif np.isfinite(bound.value):
        assert bound.value < 0.05 or electrons < 10
    lowest = min(float(m.min()) for m in made) / electrons
    worst = np.max(np.abs(rates[0] - rates[1]) / np.maximum(rates[1], lowest / (1 + dead)))
    assert worst <= bound.value
    assert np.mean(found != expected) < 1e-3  # the same draws: spikes differ at near ties alone


@pytest.mark.parametrize("seed", range(6))
def test_under_a_hard_reset_the_estimate_holds(device: Device, seed: int) -> None:
    random, shape, cycles = np.random.default_rng(seed), (40, 100), 640
    electrons = float(10 ** random.uniform(1, 5))
    model = ExactModel(electrons, seed, ALL, reset="hard", dead_time=0.2 * (seed % 2))
    numbers = np.arange(4000, dtype=np.uint32)
    gain = electrons * 40_000.0
    brightest = random.uniform(0.3, 1.5)
    planes = [random.uniform(0.2, brightest, shape).astype(np.float32) for _ in range(30)]
    knots = np.cumsum(random.integers(PERIOD // 2, 60 * PERIOD, 30)).tolist()
    spans = zip(itertools.pairwise([0, *knots]), planes, strict=True)
    made = [Piece(a, b, p, p) for (a, b), p in spans]
    light = Light((*made, Piece(knots[-1], PS, planes[0], planes[0])))
    bound = rate_bound(model, 0.2 * electrons, brightest * electrons, cycles)
    assert bound.kind == "estimate" and bound.value < 0.02
    fast = FastPixels(PixelArray(model, shape, numbers, CLOCK, gain), device)
    exact = NumpyPixels(model, numbers)
    before = fast.fraction(), exact_rate(model, exact, numbers)
    found = run(fast, light, [0, 64, 640])
    expected = bits(exact.expose(Exposure(CLOCK, gain).spans(light, 0, cycles), cycles), cycles)
    after = fast.fraction(), exact_rate(model, exact, numbers)
    off = found.sum(axis=0, dtype=float) - expected.sum(axis=0, dtype=float)
    off += after[0] - before[0] - after[1] + before[1]
    rms = float(np.sqrt(np.mean((off / cycles / 0.2) ** 2)))
    assert 0 < rms <= 2 * bound.value
    assert np.mean(found != expected) < 1e-3


def test_the_bound_says_where_nothing_is_promised() -> None:
    model = ExactModel(1000.0, 1, ALL)
    assert rate_bound(model, 300.0, 600.0, 100).value < 1e-4
    assert rate_bound(model, 300.0, 900.0, 100).value == np.inf
    assert rate_bound(model, 1e5, 1e6, 100).value == pytest.approx(0.02)
    assert rate_bound(model, 0.0, 600.0, 100).value == np.inf
    assert rate_bound(model, 0.0, 600.0, 100, floor=1e-3).value < 0.05
    steady = ExactModel(1000.0, 1, (RESIDUAL,))
    assert rate_bound(steady, 600.0, 600.0, 100).value < 2e-6
    hard = ExactModel(1000.0, 1, ALL, reset="hard")
    assert rate_bound(hard, 300.0, 600.0, 100).kind == "estimate"
    assert 2e-6 < rate_bound(hard, 300.0, 600.0, 100).value < 1e-2
    assert rate_bound(hard, 0.0, 600.0, 100, floor=0.1).value == np.inf
    assert rate_bound(replace(hard, effects=()), 300.0, 600.0, 100).value == np.inf
    piled = replace(hard, reset="subtract")
    assert rate_bound(piled, 300.0, 600.0, 100).value < 1e-4
    assert rate_bound(piled, 1e5, 1e6, 100).value == np.inf
    # Errors of all cycles add up, and matter in a short window at the end of a long run.
    short = rate_bound(model, 300.0, 600.0, 100).value
    assert rate_bound(model, 300.0, 600.0, 100, cycles=10**6).value > 100 * short


def test_spike_indices_beyond_2_to_the_32_agree(device: Device) -> None:
    plane = level(SHAPE, 1, 0.8)
    light, model = Light((Piece(0, PS, plane, plane),)), ExactModel(100.0, 1, ALL)
    array = PixelArray(model, SHAPE, NUMBERS, CLOCK, 100.0 * 40_000)
    fast, plain = FastPixels(array, device), NumpyFast(array)
    words = []
    for pixels in (fast, plain):
        words.append(run(pixels, light, [0, 60]))
        state = pixels.state()
        state["spikes"][:] = 2**32 - 3 - np.arange(N, dtype=np.uint64) % 4
        pixels.restore(state)
        words.append(run(pixels, light, [60, 150]))
    assert np.array_equal(words[1], words[3])
    fresh = run(NumpyFast(array), light, [0, 150])[60:]
    assert not np.array_equal(fresh, words[3])
    assert np.array_equal(fast.state()["spikes"], plain.state()["spikes"])
    assert fast.state()["spikes"].max() > 2**32


def test_light_is_held_where_the_exact_tier_holds_it(device: Device) -> None:
    # A ramp from beyond LARGEST into the dark leaves saturation in the same cycle.
    model = ExactModel(1e5, 1, (RESIDUAL,))
    first = np.full((1, 16), 1e9, np.float32)
    light = Light((Piece(0, 100 * PERIOD, first, np.zeros_like(first)),))
    numbers = np.arange(16, dtype=np.uint32)
    fast = FastPixels(PixelArray(model, (1, 16), numbers, CLOCK, 40_000.0), device)
    spans = Exposure(CLOCK, 40_000.0).spans(light, 0, 100)
    exact = bits(NumpyPixels(model, numbers).expose(spans, 100), 100)
    # After saturation the phases differ.
    saturated = int(100 * (1 - 1e5 / LARGEST))
    found = run(fast, light, [0, 100])
    assert np.array_equal(found[: saturated - 1], exact[: saturated - 1])
    assert np.abs(found.sum(axis=0, dtype=int) - exact.sum(axis=0, dtype=int)).max() <= 1
    assert not found.all()


def test_what_it_cannot_do_is_refused(device: Device) -> None:
    array = partial(PixelArray, clock=CLOCK, gain=1.0)
    model = ExactModel(100.0, 1, ALL)
    with pytest.raises(ValueError, match="numbers must be 315"):
        array(model, SHAPE, NUMBERS[1:])
    with pytest.raises(ValueError, match="flags must have shape"):
        array(model, SHAPE, NUMBERS, flags=np.zeros((7, 2), np.uint8))
    with pytest.raises(ValueError, match="offsets must be 7"):
        array(model, SHAPE, NUMBERS, offsets=np.zeros(3, np.int64))
    pixels = FastPixels(array(model, SHAPE, NUMBERS), device)
    plane = np.ones(SHAPE, np.float32)
    with pytest.raises(ValueError, match="light must cover"):
        pixels.expose(Light((Piece(0, PERIOD, plane, plane),)), 0, 2)
    with pytest.raises(ValueError, match="light must fall on"):
        row = FastPixels(array(model, (1, 315), NUMBERS), device)
        row.expose(Light((Piece(0, PERIOD, plane, plane),)), 0, 1)


@pytest.mark.parametrize("flag", [0, DEAD_TIME, NOISE, NOISE | BANK])
@pytest.mark.parametrize("bad", [-1.0, np.nan])
def test_negative_light_is_refused_wherever_it_changes(device, flag, bad):
    model = ExactModel(1000.0, 1, tuple(EFFECTS.values()), dead_time=0.01)
    flags = np.full((SHAPE[0], -(-SHAPE[1] // 16)), flag, np.uint8)
    plane, wrong = np.ones(SHAPE, np.float32), np.ones(SHAPE, np.float32)
    wrong[3, 3] = bad
    still, ends = Piece(0, PERIOD, wrong, wrong), Piece(0, 2 * PERIOD, plane, wrong)
    for piece, cycles in ((still, 1), (ends, 2), (replace(ends, changed=(3, 4, 0, 4)), 2)):
        array = PixelArray(model, SHAPE, NUMBERS, CLOCK, 40_000.0, flags=flags)
        pixels = FastPixels(array, device)
        with pytest.raises(ValueError, match=f"light must be 0 or more, not {bad:g}"):
            pixels.expose(Light((piece,)), 0, cycles)
        whole = Light((Piece(0, PERIOD, plane, plane),))
        assert pixels.expose(whole, 0, 1).shape == (1, plane.size)
