"""The exact tier: OpenCL, numba and numpy agree on every bit, for any tiling and any split."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from cosim.compute.opencl import Device
from sensor.latched.effects import EFFECTS, RESIDUAL, SHOT_NOISE
from sensor.latched.pixel.charge import LARGEST, ONE, Span, to_fixed
from sensor.latched.pixel.compiled import CompiledPixels
from sensor.latched.pixel.kernel import KernelPixels
from sensor.latched.pixel.model import ExactModel, ExactPixels, Reset
from sensor.latched.pixel.numpy_form import NumpyPixels

NOISELESS = (RESIDUAL,)
ALL = tuple(EFFECTS.values())


def light(
    n: int, threshold: float, cycles: int, ramp: bool, seed: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64] | None]:
    """Charges from dark to 30 thresholds a cycle, with ramps that start or end in the dark."""
    random = np.random.default_rng(seed)
    first = to_fixed(threshold * 10 ** random.uniform(-4, 1.5, n))
    last = to_fixed(threshold * 10 ** random.uniform(-4, 1.5, n))
    first[:4], last[2:6] = 0, 0
    if not ramp:
        return first, None
    return first, ((last - first) / (cycles - 1) * (1 - 2**-40)).astype(np.int64)


def split(
    cuts: list[int], charge: npt.NDArray[np.int64], slope: npt.NDArray[np.int64] | None
) -> list[Span]:
    """The course of light, split into several spans."""
    return [Span(a, b - a, charge, slope, a) for a, b in itertools.pairwise(cuts)]


@pytest.mark.parametrize("effects", [NOISELESS, ALL], ids=["noiseless", "all"])
@pytest.mark.parametrize(("threshold", "shift"), [(1.0, 0.0), (1000.0, 40.0), (1000.0, -40.0)])
def test_first_draws_of_many_pixels_are_those_of_few(
    effects: tuple, threshold: float, shift: float
) -> None:
    pixels = np.random.default_rng(1).integers(0, 2**32, 9000, dtype=np.uint32)
    model = ExactModel(threshold, 7, effects, threshold_noise=threshold / 100, shift=shift)
    many = model.initial(pixels)
    few = [model.initial(some).deficit for some in np.split(pixels, 9)]
    assert np.array_equal(many.deficit, np.concatenate(few)) and not many.spikes.any()


@pytest.mark.parametrize("ramp", [False, True])
@pytest.mark.parametrize("effects", [NOISELESS, ALL], ids=["noiseless", "all"])
@pytest.mark.parametrize(
    ("threshold", "noise"),
    [(1.0, 0.0), (2.5, 0.0), (100.0, 0.0), (1000.0, 0.0), (30000.0, 0.0), (2e6, 0.0), (2e6, 3e4)],
)
def test_the_three_forms_agree_with_plain_numpy_on_every_bit(
    device: Device, threshold: float, noise: float, effects: tuple, ramp: bool
) -> None:
    n, cycles = 1003, 150  # neither whole work-items nor whole words
    pixels = np.random.default_rng(1).integers(0, 2**32, n, dtype=np.uint32)
    model = ExactModel(threshold, 7, effects, threshold_noise=noise)
    charge, slope = light(n, threshold, cycles, ramp, 2)
    plain = NumpyPixels(model, pixels)
    expected = plain.expose([Span(0, cycles, charge, slope)], cycles)
    assert 0 < np.bitwise_count(expected).sum() < n * cycles
    forms: list[ExactPixels] = [
        CompiledPixels(model, pixels),
        KernelPixels(model, pixels, device),
    ]
    for form in forms:
        words = form.expose(split([0, 1, 33, 64, 65, 100, 150], charge, slope), cycles)
        assert np.array_equal(words, expected)
        assert np.array_equal(form.state().deficit, plain.state().deficit)
        if SHOT_NOISE in effects:
            assert np.array_equal(form.state().spikes, plain.state().spikes)


def agree(device: Device, cycles: int, effects: tuple, ramp: bool, threshold: float) -> int:
    """Bits that differ between OpenCL in blocks and numba in one run, over a megapixel."""
    n = 1_000_000
    pixels = np.arange(n, dtype=np.uint32)
    model = ExactModel(threshold, 11, effects)
    charge, slope = light(n, threshold / 30, cycles, ramp, 3)
    whole = CompiledPixels(model, pixels).expose([Span(0, cycles, charge, slope)], cycles)
    kernel, wrong, block = KernelPixels(model, pixels, device), 0, 96
    for start in range(0, cycles, block):
        size = min(block, cycles - start)
        words = kernel.expose([Span(0, size, charge, slope, start)], size)
        wrong += int(np.bitwise_count(words ^ whole[start // 32 :][: len(words)]).sum())
    return wrong


@pytest.mark.parametrize(
    ("effects", "ramp", "threshold"),
    [(NOISELESS, False, 1000.0), (ALL, False, 300.0), (ALL, True, 1000.0)],
)
def test_opencl_and_numba_agree_on_1e8_pixel_cycles(
    device: Device, effects: tuple, ramp: bool, threshold: float
) -> None:
    assert agree(device, 96, effects, ramp, threshold) == 0  # 3 x 96e6


@pytest.mark.slow
@pytest.mark.parametrize("ramp", [False, True])
@pytest.mark.parametrize("effects", [NOISELESS, ALL], ids=["noiseless", "all"])
def test_opencl_and_numba_agree_on_1e9_pixel_cycles(
    device: Device, effects: tuple, ramp: bool
) -> None:
    assert agree(device, 1056, effects, ramp, 1000.0) == 0


def test_a_pixel_does_not_depend_on_the_tile_it_is_simulated_in(device: Device) -> None:
    n, cycles = 4000, 128
    model = ExactModel(200.0, 5, ALL)
    charge, slope = light(n, 200.0, cycles, True, 4)
    assert slope is not None
    pixels = np.arange(n, dtype=np.uint32)
    whole = KernelPixels(model, pixels, device).expose([Span(0, cycles, charge, slope)], cycles)
    order = np.random.default_rng(6).permutation(n)
    for tile in np.split(order, [17, 500, 1777, 1778, 3001]):
        part = KernelPixels(model, pixels[tile], device)
        words = part.expose([Span(0, cycles, charge[tile], slope[tile])], cycles)
        assert np.array_equal(words, whole[:, tile])


def test_a_run_restored_from_its_state_goes_on_with_the_same_bits(device: Device) -> None:
    n, pixels = 333, np.arange(333, dtype=np.uint32)
    model = ExactModel(50.0, 9, ALL)
    charge, _ = light(n, 50.0, 192, False, 8)
    once = KernelPixels(model, pixels, device)
    first = once.expose([Span(0, 64, charge)], 64)
    kept = once.state()
    second = once.expose([Span(0, 128, charge, None, 64)], 128)
    later = CompiledPixels(model, pixels)
    later.restore(kept)
    assert np.array_equal(later.expose([Span(0, 128, charge, None, 64)], 128), second)
    assert first.any() and second.any()


def test_spike_indices_beyond_2_to_the_32_agree_and_do_not_repeat(device: Device) -> None:
    n, pixels = 64, np.arange(64, dtype=np.uint32)
    model = ExactModel(100.0, 1, ALL)
    charge = np.full(n, 30 * ONE, np.int64)
    forms: list[ExactPixels] = [NumpyPixels(model, pixels), KernelPixels(model, pixels, device)]
    words = []
    for form in forms:
        state = form.state()
        state.spikes[:] = 2**32 - 3
        form.restore(state)
        words.append(form.expose([Span(0, 320, charge)], 320))
    assert np.array_equal(*words)
    fresh = NumpyPixels(model, pixels).expose([Span(0, 320, charge)], 320)
    assert not np.array_equal(fresh, words[0])


class TestClosedForms:
    """Without noise a pixel is N = floor((charge at the start + light) / Q)."""

    @pytest.mark.parametrize("form", ["plain", "numba", "opencl"])
    def test_constant_light_gives_floor_of_charge_over_q(self, device: Device, form: str) -> None:
        n, cycles, q = 2000, 640, 1000.0
        model = ExactModel(q, 1, NOISELESS)
        pixels = np.arange(n, dtype=np.uint32)
        charge = to_fixed(np.linspace(0, 0.999 * q, n))
        made: dict[str, ExactPixels] = {
            "plain": NumpyPixels(model, pixels),
            "numba": CompiledPixels(model, pixels),
            "opencl": KernelPixels(model, pixels, device),
        }
        words = made[form].expose([Span(0, cycles, charge)], cycles)
        counts = np.bitwise_count(words).sum(axis=0)
        expected = np.array([int(c) * cycles // model.q for c in charge])
        assert np.array_equal(counts, expected)
        # Charge is conserved: input = spikes Q + stored charge.
        stored = model.q - 1 - made[form].state().deficit
        assert np.array_equal(charge * cycles, counts.astype(np.int64) * model.q + stored)

    def test_a_ramp_spikes_at_the_roots_of_its_quadratic(self, device: Device) -> None:
        q, cycles = 500.0, 3000
        model = ExactModel(q, 1, NOISELESS)
        first, slope = 0.25 * ONE, 0.05 * ONE
        pixels = KernelPixels(model, np.zeros(1, np.uint32), device)
        spans = [Span(0, cycles, np.array([int(first)]), np.array([int(slope)]))]
        words = pixels.expose(spans, cycles)
        bits = np.unpackbits(words.view(np.uint8), bitorder="little")[:cycles]
        j = np.arange(1, cycles + 1, dtype=object)  # exact integers
        gathered = [int(first) * n + int(slope) * (n * (n - 1) // 2) for n in j]
        crossings = np.diff([0] + [g // model.q for g in gathered])
        assert np.array_equal(bits, np.minimum(crossings, 1))

    def test_a_saturated_pixel_fires_in_every_cycle_and_a_dark_one_never(
        self, device: Device
    ) -> None:
        for effects in (NOISELESS, ALL):
            model = ExactModel(100.0, 3, effects)
            pixels = KernelPixels(model, np.arange(32, dtype=np.uint32), device)
            charge = np.zeros(32, np.int64)
            charge[:16] = 7e5 * ONE  # 1e5 lux on 100 um2: 7000 thresholds a cycle
            words = pixels.expose([Span(0, 640, charge)], 640)
            assert (words[:, :16] == 0xFFFFFFFF).all()
            assert not words[:, 16:].any()

    def test_charge_that_equals_the_threshold_fires(self, device: Device) -> None:
        model = ExactModel(8.0, 1, NOISELESS)
        charge = np.array([2 * ONE, 2 * ONE - 1, 2 * ONE + 1])
        for pixels in (
            NumpyPixels(model, np.arange(3, dtype=np.uint32)),
            KernelPixels(model, np.arange(3, dtype=np.uint32), device),
        ):
            words = pixels.expose([Span(0, 5, charge)], 5)
            assert words[0].tolist() == [0b01000, 0b10000, 0b01000]

    def test_a_dim_pixel_keeps_its_rate_where_float32_loses_it(self) -> None:
        # 20, 50 and 100 e/s at 40 kHz in 18 725 e (5 fF, 0.6 V): 2e8 cycles in closed form.
        model = ExactModel(18_725.0, 1, NOISELESS)
        for rate, expected in ((20.0, 5), (50.0, 13), (100.0, 26)):
            charge = int(to_fixed(rate / 40e3))
            assert charge * 200_000_000 // model.q == expected
            gathered = np.float32(18_000.0)
            assert gathered + np.float32(rate / 40e3) == pytest.approx(18_000, abs=2e-3)


def test_limits_of_the_model_are_refused() -> None:
    for threshold in (0.0, -1.0, float(LARGEST), float("nan")):
        with pytest.raises(ValueError, match="threshold must be above 0"):
            ExactModel(threshold, 1, ALL)
    for seed in (-1, 2**32):
        with pytest.raises(ValueError, match="seed must be"):
            ExactModel(100.0, seed, ALL)


@pytest.mark.parametrize("reset", ["residual", "hard", "subtract"])
@pytest.mark.parametrize(("noise", "dead"), [(False, 0.0), (True, 0.0), (True, 0.3)])
def test_light_that_changes_every_few_cycles_gives_the_same_bits(
    device: Device, reset: Reset, noise: bool, dead: float
) -> None:
    n, cycles, random = 203, 400, np.random.default_rng(3)
    pixels = random.integers(0, 2**32, n, dtype=np.uint32)
    model = ExactModel(50.0, 9, ALL if noise else NOISELESS, reset=reset, dead_time=dead)
    spans, at = [], 0
    lit = to_fixed(50 * 10 ** random.uniform(-2, 0.6, (60, n)))
    while at < cycles:
        size = min(int(random.choice([1, 1, 2, 5, 8, 9, 40])), cycles - at)
        charge, slope, elapsed = lit[random.integers(60)], None, 0
        if random.random() < 0.3:
            slope, elapsed = lit[random.integers(60)] // 512, int(random.integers(9))
        spans.append(Span(at, size, charge, slope, elapsed))
        at += size
    plain, kernel = NumpyPixels(model, pixels), KernelPixels(model, pixels, device)
    expected = plain.expose(spans, cycles)
    assert 0.1 < np.bitwise_count(expected).sum() / (n * cycles) < 0.9
    assert np.array_equal(kernel.expose(iter(spans), cycles), expected)
    assert np.array_equal(kernel.state().deficit, plain.state().deficit)
    if noise:
        assert np.array_equal(kernel.state().spikes, plain.state().spikes)
    # Cut within a word and within a span: the rest follows in the next call.
    again, cut = KernelPixels(model, pixels, device), next(s for s in spans if s.cycles == 5)
    middle = cut.first + 2
    head = [s for s in spans if s.first < cut.first] + [replace(cut, cycles=2)]
    tail = [replace(cut, cycles=3, elapsed=cut.elapsed + 2)]
    tail += [s for s in spans if s.first > cut.first]
    moved = [replace(s, first=max(s.first - middle, 0)) for s in tail]
    parts = again.expose(head, middle), again.expose(moved, cycles - middle)
    whole = [_flags(w, c) for w, c in zip(parts, (middle, cycles - middle), strict=True)]
    assert np.array_equal(np.concatenate(whole), _flags(expected, cycles))


def _flags(words: npt.NDArray[np.uint32], cycles: int) -> npt.NDArray[np.uint8]:
    """(cycles, n) of 0 and 1."""
    flat = np.unpackbits(words.T.copy().view(np.uint8), axis=1, bitorder="little")
    return flat[:, :cycles].T
