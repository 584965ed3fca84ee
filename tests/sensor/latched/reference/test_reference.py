"""The reference pixel: closed forms, bits of the exact tier, any split, time and brightness."""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest

from cosim import PS, Clock, Light, Piece
from sensor.device.pattern import DevicePattern
from sensor.latched.effects import EFFECTS, RESIDUAL, SHOT_NOISE
from sensor.latched.effects.initial_charge import INITIAL_CHARGE
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE
from sensor.latched.pixel.compiled import CompiledPixels
from sensor.latched.pixel.model import ExactModel
from sensor.latched.reference import ReferencePixels
from sensor.latched.sampling import row_offsets
from tests.sensor.latched.piecewise import light_between

CLOCK = Clock(40_000)
PERIOD = PS // 40_000
ALL = tuple(EFFECTS.values())
IDEAL = (RESIDUAL, INITIAL_CHARGE)
SHAPE = (12, 10)
N = SHAPE[0] * SHAPE[1]
NUMBERS = np.arange(7, 7 + N, dtype=np.uint32)


def steady(levels: npt.ArrayLike, stop: int, start: int = 0) -> Light:
    plane = np.atleast_2d(np.asarray(levels, np.float32))
    return Light((Piece(start, stop, plane, plane),))


def bits(words: npt.NDArray[np.uint32], cycles: int) -> npt.NDArray[np.uint8]:
    """(n, cycles) of 0 and 1."""
    return np.unpackbits(words.T.copy().view(np.uint8), axis=1, bitorder="little")[:, :cycles]


def random_light(seed: int, cycles: int) -> Light:
    random = np.random.default_rng(seed)
    inner = np.unique(random.integers(1, (cycles + 2) * PERIOD, random.integers(1, 12))).tolist()
    return light_between(SHAPE, [0, *inner, (cycles + 3) * PERIOD], bool(seed % 2))


class TestClosedForms:
    def test_constant_light_fires_floor_of_charge_over_q_with_nothing_lost(self) -> None:
        n, cycles, q = 999, 640, 1000.0
        rate = np.linspace(0, 0.999 * q * 40e3, n, dtype=np.float32)
        made = ReferencePixels(
            ExactModel(q, 1, (RESIDUAL,)), np.arange(n, dtype=np.uint32), CLOCK, 1.0
        )
        words = made.expose(steady(rate, cycles * PERIOD), 0, cycles)
        counts = np.bitwise_count(words).sum(axis=0)
        gathered = rate.astype(float) * cycles / 40e3
        assert np.allclose(counts + made.fraction(), gathered / q, rtol=1e-12, atol=1e-12)
        assert counts.sum() > 300 * n

    def test_a_ramp_fires_at_the_roots_of_its_quadratic(self) -> None:
        cycles, q, peak = 4000, 501.3, 1.5e7
        stop = cycles * PERIOD
        for first, last in ((0.0, peak), (peak, 0.0), (peak / 3, peak)):
            light = Light((Piece(0, stop, np.full((1, 1), first, np.float32),
                                 np.full((1, 1), last, np.float32)),))  # fmt: skip
            made = ReferencePixels(
                ExactModel(q, 1, (RESIDUAL,)), np.zeros(1, np.uint32), CLOCK, 1.0
            )
            fired = np.flatnonzero(bits(made.expose(light, 0, cycles), cycles)[0])
            span = cycles / 40e3
            k = np.arange(1, fired.size + 1)
            a = (last - first) / span / 2
            at = 2 * k * q / (first + np.sqrt(np.maximum(first**2 + 4 * a * k * q, 0)))
            assert fired.size == math.floor((first + last) / 2 * span / q + 1e-9)
            assert np.array_equal(fired, np.ceil(at * 40e3 - 1e-7) - 1)

    @pytest.mark.parametrize("share", [0.0, 0.013, 0.4, 1.0])
    def test_dead_time_gives_its_rate_below_and_beyond_the_clock(self, share: float) -> None:
        # 1 / (Q / light + dead time) spikes a second (Knoll), from dim to 70 spikes a cycle.
        cycles, q = 4000, 1000.0
        rate = np.geomspace(1e6, 2.8e9, 400).astype(np.float32)
        model = ExactModel(q, 1, (RESIDUAL,), dead_time=share)
        made = ReferencePixels(model, np.arange(400, dtype=np.uint32), CLOCK, 1.0)
        words = made.expose(steady(rate, cycles * PERIOD), 0, cycles)
        interval = q / rate.astype(float) + share / 40e3
        time = cycles / 40e3
        phase = (time + share / 40e3) / interval  # the first has no dead time before it
        k = np.floor(phase)
        light = np.maximum(time - k * interval, 0)
        near = np.abs(phase - np.rint(phase)) < 1e-9
        counted = np.bitwise_count(words).sum(axis=0)
        slow = (interval > 1 / 40e3) & ~near
        assert np.array_equal(counted[slow], k[slow])
        # The phase as well, also where tens of intervals fit in a cycle and are skipped at once.
        assert np.allclose(made.fraction()[~near], (light * rate / q)[~near], rtol=0, atol=1e-8)
        assert (counted[interval < 1 / 40e3] > 0.99 * cycles).all()

    @pytest.mark.parametrize("hours", [0, 30, 2000])
    def test_time_does_not_degrade_over_hours(self, hours: int) -> None:
        # A tick beyond 2^32 cycles and the same light: the same bits.
        start = hours * 3600 * 40_000
        begun = CLOCK.edge(start)
        rate = np.geomspace(1e5, 3e7, 60)
        made = ReferencePixels(
            ExactModel(333.0, 4, ALL), np.arange(60, dtype=np.uint32), CLOCK, 1.0
        )
        late = made.expose(steady(rate, begun + 500 * PERIOD, begun), start, 500)
        early = ReferencePixels(
            ExactModel(333.0, 4, ALL), np.arange(60, dtype=np.uint32), CLOCK, 1.0
        )
        assert np.array_equal(late, early.expose(steady(rate, 500 * PERIOD), 0, 500))
        assert np.allclose(made.fraction(), early.fraction(), rtol=0, atol=1e-12)

    def test_a_flash_of_a_nanosecond_in_the_dark_is_seen_at_its_place(self) -> None:
        dark, flash = np.zeros((1, 1), np.float32), np.full((1, 1), 2.5e11, np.float32)
        at, cycles = 9 * PS + 3 * PERIOD // 7, 400_010
        light = Light((Piece(0, at, dark, dark), Piece(at, at + 1000, flash, flash),
                       Piece(at + 1000, 11 * PS, dark, dark)))  # fmt: skip
        made = ReferencePixels(ExactModel(70.0, 1, (RESIDUAL,)), np.zeros(1, np.uint32), CLOCK, 0.3)
        fired = np.flatnonzero(bits(made.expose(light, 0, cycles), cycles)[0])
        assert fired.tolist() == [CLOCK.cycle_at(at)]
        assert made.fraction()[0] == pytest.approx(
            (float(np.float32(2.5e11)) * 0.3e-9 - 70) / 70, rel=1e-12
        )

    @pytest.mark.parametrize("reset", ["residual", "hard", "subtract"])
    def test_a_crossing_at_the_latch_counts_there(self, reset: str) -> None:
        model = ExactModel(8.0, 1, (RESIDUAL,), reset=reset)  # type: ignore[arg-type]
        made = ReferencePixels(model, np.arange(3, dtype=np.uint32), CLOCK, 1.0)
        rate = np.array([80_000, np.nextafter(np.float32(80_000), 0), 81_000], np.float32)
        fired = bits(made.expose(steady(rate, 5000 * PERIOD), 0, 8), 8)
        assert fired.tolist()[0] == [0, 0, 0, 1, 0, 0, 0, 1]
        assert fired.tolist()[1][:5] == [0, 0, 0, 0, 1]

    def test_dark_costs_nothing_and_says_nothing(self) -> None:
        made = ReferencePixels(ExactModel(5.0, 1, ALL), np.arange(4, dtype=np.uint32), CLOCK, 1.0)
        before = made.fraction()
        assert not made.expose(steady(np.zeros(4), 2**62), 0, 100_000).any()
        assert np.array_equal(made.fraction(), before)


class TestExactTier:
    """Cases in which both must agree on all bits: no dead time, any reset, rows, light."""

    @pytest.mark.parametrize("seed", range(12))
    def test_every_bit_agrees_without_a_draw(self, seed: int) -> None:
        random, cycles = np.random.default_rng(seed), 200
        q = float(random.choice([1.0, 7.5, 1000.0, 3e4]))
        reset = ("residual", "hard", "subtract")[seed % 3]
        effects = IDEAL if seed % 4 else (RESIDUAL,)
        model = ExactModel(q, seed, effects, 0.0, reset)  # type: ignore[arg-type]
        wrong, spikes = self.compare(model, random, seed, cycles)
        assert wrong == 0
        assert spikes > 50

    @pytest.mark.parametrize("seed", range(9))
    def test_with_noise_only_the_tables_rounding_shows(self, seed: int) -> None:
        # The table of the exact tier has errors up to 1e-4 of a threshold's spread (see its test):
        # a bit differs if a crossing is this close to a latch.
        random, cycles = np.random.default_rng(seed), 200
        model = ExactModel(
            float(random.choice([100.0, 1000.0, 3e4])), seed, ALL, 0.0,
            ("residual", "hard", "subtract")[seed % 3],  # type: ignore[arg-type]
        )  # fmt: skip
        wrong, spikes = self.compare(model, random, seed, cycles)
        assert spikes > 50
        assert wrong <= 2 + 2e-3 * spikes

    @staticmethod
    def compare(
        model: ExactModel, random: np.random.Generator, seed: int, cycles: int
    ) -> tuple[int, int]:
        light = random_light(seed, cycles)
        gain = model.threshold * 40e3 / 350 * 10 ** random.uniform(-2, 1.3)
        rows = row_offsets(CLOCK, SHAPE[0], 0.9 * (seed % 2), 4e-6 * (seed % 5 > 2), (0, SHAPE[0]))
        fixed = DevicePattern(prnu=0.1, dark=500.0, threshold_fpn=0.02).at(NUMBERS)
        exact, exposure = CompiledPixels(model, NUMBERS), Exposure(CLOCK, gain, fixed, rows)
        expected = exact.expose(exposure.spans(light, 0, cycles), cycles)
        offsets = np.repeat(rows, SHAPE[1])
        made = ReferencePixels(model, NUMBERS, CLOCK, gain, fixed, offsets)
        words = made.expose(light, 0, cycles)
        if model.noisy:
            same = exact.state().spikes == made.state()["spikes"]
            assert same.mean() > 0.95
        else:
            stored = (model.q - 1 - exact.state().deficit) / ONE
            assert np.allclose(made.state()["held"], stored, rtol=1e-9, atol=1e-6)
        return int(np.bitwise_count(words ^ expected).sum()), int(np.bitwise_count(words).sum())


@pytest.mark.parametrize("seed", range(6))
def test_results_do_not_depend_on_how_a_run_is_split_or_tiled(seed: int) -> None:
    random, cycles = np.random.default_rng(seed), 150
    light = random_light(seed, cycles)
    reset = ("residual", "hard", "subtract")[seed % 3]
    model = ExactModel(40.0, 3, ALL, 0.0, reset, 0.3 * (seed > 2))  # type: ignore[arg-type]
    offsets = random.integers(-PERIOD, PERIOD, N)
    gain = 40.0 * 40e3 / 350 * 10 ** random.uniform(-1, 1)
    once = ReferencePixels(model, NUMBERS, CLOCK, gain, None, offsets)
    whole = bits(once.expose(light, 1, cycles), cycles)
    parts, made = [], ReferencePixels(model, NUMBERS, CLOCK, gain, None, offsets)
    for a, b in itertools.pairwise([0, 1, 2, *sorted(random.integers(3, 149, 5)), cycles]):
        after = ReferencePixels(model, NUMBERS, CLOCK, gain, None, offsets)
        after.restore(made.state()) if a else None
        parts.append(bits(after.expose(light, 1 + a, b - a), b - a))
        made = after
    assert np.array_equal(np.concatenate(parts, axis=1), whole)
    for key, value in once.state().items():
        assert np.array_equal(value, made.state()[key]), key
    half = N // 2
    crop = Light(
        tuple(
            Piece(p.start, p.stop, p.first[: SHAPE[0] // 2], p.first[: SHAPE[0] // 2])
            if p.constant
            else Piece(p.start, p.stop, p.first[: SHAPE[0] // 2], p.last[: SHAPE[0] // 2])
            for p in light.pieces
        )
    )
    tile = ReferencePixels(model, NUMBERS[:half], CLOCK, gain, None, offsets[:half])
    assert np.array_equal(bits(tile.expose(crop, 1, cycles), cycles), whole[:half])


def test_light_cut_anew_for_each_call_gives_the_same_to_rounding() -> None:
    model = ExactModel(100.0, 3, (RESIDUAL, SHOT_NOISE, INITIAL_CHARGE))
    levels = np.linspace(0, 3e6, 50)
    one = ReferencePixels(model, np.arange(50, dtype=np.uint32), CLOCK, 1.0)
    whole = bits(one.expose(steady(levels, 90 * PERIOD), 0, 90), 90)
    two = ReferencePixels(model, np.arange(50, dtype=np.uint32), CLOCK, 1.0)
    cut = [
        bits(two.expose(steady(levels, (a + 30) * PERIOD, a * PERIOD), a, 30), 30)
        for a in (0, 30, 60)
    ]
    assert np.array_equal(np.concatenate(cut, axis=1), whole)
    assert np.allclose(one.fraction(), two.fraction(), rtol=1e-10)


def test_wrong_calls_are_refused() -> None:
    made = ReferencePixels(ExactModel(5.0, 1, ALL), np.arange(4, dtype=np.uint32), CLOCK, 1.0)
    with pytest.raises(ValueError, match="light must fall on 4 pixels, not"):
        made.expose(steady(np.zeros(5), PS), 0, 10)
    with pytest.raises(ValueError, match="light must cover 0 to"):
        made.expose(steady(np.zeros(4), 9 * PERIOD), 0, 10)
    with pytest.raises(ValueError, match="light must be 0 or more, not -1"):
        made.expose(steady(np.full(4, -1.0), PS), 0, 10)
    made.expose(steady(np.zeros(4), PS), 0, 10)
    with pytest.raises(ValueError, match="cycles must go on at 10, not at 11"):
        made.expose(steady(np.zeros(4), PS), 11, 10)
    with pytest.raises(ValueError, match="offsets must be"):
        ReferencePixels(ExactModel(5.0, 1, ALL), NUMBERS, CLOCK, 1.0, None, np.zeros(3, np.int64))
