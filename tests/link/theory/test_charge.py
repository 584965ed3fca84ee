"""One pixel as a channel: run lengths, reset rules, row skew, estimates of cells.

The law of a pixel's spikes under light that changes, held against its charge's exact chain.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import gammaincc
from scipy.stats import poisson

from link.theory import (
    charge_errors,
    clopper_pearson,
    hard_patterns,
    longest_off_run,
    pixel_errors,
    poisson_threshold,
)
from link.theory.charge import PixelChannel, charge_kernels, survival
from link.theory.trials import charge_trials, poisson_trials


@pytest.mark.parametrize("q", [50, 1000])
def test_survival_is_the_gamma_law_of_the_threshold(q):
    mean = np.linspace(0.8, 1.25, 40)
    assert survival(mean, q) == pytest.approx(gammaincc(q, mean * q), abs=2e-4)
    tail = np.array([1 - 4 / np.sqrt(q), 1 + 4 / np.sqrt(q)])
    exact = gammaincc(q, tail * q)
    assert np.log(survival(tail[1:], q)) == pytest.approx(np.log(exact[1:]), abs=0.2)
    assert survival(1.0, q, 0.0) > survival(1.05, q, 0.0)
    # a noisy threshold: of an interval's law, the variances of both add up
    assert survival(1.1, q, 0.1 * q) > 10 * survival(1.1, q) or q < 100


def test_patterns_are_those_of_the_charges_chain():
    q, window = 60, 4
    light = np.random.default_rng(2).uniform(0.0, 1.4, (5, 7))
    found = hard_patterns(light, window, q)
    assert found.sum(axis=-1) == pytest.approx(np.ones(5), abs=1e-12)
    for row, law in zip(light, found, strict=True):
        state = {0: np.eye(q)[0]}
        for tick, mean in enumerate(row):
            kernel = charge_kernels("hard", q, mean * q)
            at, after = tick - (len(row) - window), {}
            for seen, charge in state.items():
                for spike in (0, 1):
                    told = seen | (spike << at) if at >= 0 else 0
                    after[told] = after.get(told, 0) + charge @ kernel[spike]
            state = after
        exact = np.array([state[n].sum() for n in range(1 << window)])
        assert law == pytest.approx(exact, abs=4e-4)


def test_a_window_longer_than_the_light_is_refused():
    with pytest.raises(ValueError, match="window must be 1 to the 3 ticks"):
        hard_patterns(np.ones((2, 3)), 4, 100)


Q = 100


def residual_errors(q: int, mu_on: float, mu_off: float) -> tuple[float, float]:
    """`charge_errors` of `residual` in closed form, every charge being equally likely:
    p01 = E[min(N_off, q)] / q, p10 = 1 - E[min(N_on, q)] / q."""
    from scipy.special import gammainc, gammaincc

    j = np.arange(1, q + 1)
    return float(gammainc(j, mu_off).mean()), float(gammaincc(j, mu_on).mean())


@pytest.mark.parametrize(("share", "run"), [(0.05, 11), (0.10, 5), (0.15, 3), (0.20, 2)])
def test_the_longest_off_run_without_a_false_spike(share: float, run: int) -> None:
    assert longest_off_run(Q, share * Q) == run
    assert poisson.sf(Q - 1, run * share * Q) < 1e-6 <= poisson.sf(Q - 1, (run + 1) * share * Q)


def test_tails_far_below_rounding_keep_their_digits() -> None:
    p01, p10 = poisson_threshold(100, 300.0, 10.0)
    assert float(p01) == pytest.approx(poisson.sf(99, 10.0), rel=1e-9) and p01 < 1e-60
    assert float(p10) == pytest.approx(poisson.cdf(99, 300.0), rel=1e-9) and p10 < 1e-30
    assert poisson_threshold(1, 2.0, 0.0)[1] == pytest.approx(np.exp(-2.0))
    with pytest.raises(ValueError, match="at least 1"):
        poisson_threshold(0.5, 1, 1)


# ON brings 1.4 Q beside the background. The measured figures are of some 1e5 bits; the equations
# give 8.05e-5, 5.64e-5, 4.46e-4; 2.5e-6, 5.00e-3, 5.00e-2; .2000, .2100, .3000.
RESET = [
    ("hard", 0.0, 7e-5, 0.3),
    ("hard", 0.01, 5e-5, 0.3),
    ("hard", 0.1, 5e-4, 0.15),
    ("residual", 0.01, 5e-3, 0.01),
    ("residual", 0.1, 5e-2, 0.001),
    ("subtract", 0.0, 0.20, 1e-4),
    ("subtract", 0.01, 0.21, 1e-4),
    ("subtract", 0.1, 0.30, 1e-4),
]


@pytest.mark.parametrize(("reset", "share", "measured", "within"), RESET)
def test_the_reset_rule_decides(reset, share: float, measured: float, within: float) -> None:
    rate = sum(charge_errors(PixelChannel(reset, Q, (1.4 + share) * Q, share * Q))) / 2
    assert rate == pytest.approx(measured, rel=within)


def test_without_background_a_residue_is_harmless() -> None:
    p01, p10 = charge_errors(PixelChannel("residual", Q, 1.4 * Q, 0.0))
    assert p01 == 0 and 0 < p10 < 1e-5


@pytest.mark.parametrize("share", [0.0, 0.03, 0.4])
def test_residual_has_a_closed_form(share: float) -> None:
    solved = charge_errors(PixelChannel("residual", 40, 55.0, 40 * share))
    assert solved == pytest.approx(residual_errors(40, 55.0, 40 * share), rel=1e-9, abs=1e-12)


def test_subtract_reads_every_threshold_that_came() -> None:
    """The truncated equations alone, followed far enough, give what conservation does."""
    q, on, off = 10, 14.0, 1.0
    kernels = [charge_kernels("subtract", q, m, 40) for m in (off, on)]
    law = np.zeros(q * 40)
    law[0] = 1
    step = (kernels[0] + kernels[1]).sum(0) / 2
    for _ in range(12):
        step = step @ step
    law = law @ step
    p01, p10 = charge_errors(PixelChannel("subtract", q, on, off))
    assert float(law @ kernels[0][1].sum(1)) == pytest.approx(p01, rel=1e-5)
    assert float(law @ kernels[1][0].sum(1)) == pytest.approx(p10, rel=1e-3)
    assert charge_errors(PixelChannel("subtract", q, 19.0, 1.0)) == (1.0, 0.0)


@pytest.mark.parametrize("reset", ["hard", "residual", "subtract"])
def test_kernels_are_laws(reset) -> None:
    kernel = charge_kernels(reset, 30, 42.0)
    assert (kernel >= 0).all() and np.allclose(kernel.sum((0, 2)), 1, atol=1e-12)


@pytest.mark.parametrize(
    ("reset", "measured", "within"), [("hard", 0.048, 0.02), ("residual", 0.26, 0.02)]
)
def test_a_row_half_a_tick_off(reset, measured: float, within: float) -> None:
    rate = sum(charge_errors(PixelChannel(reset, Q, 1.45 * Q, 0.05 * Q, 0.5))) / 2
    assert rate == pytest.approx(measured, rel=within)


@pytest.mark.parametrize(
    ("reset", "share", "overlap", "bits"),
    [("hard", 0.15, 0.0, 60_000), ("residual", 0.1, 0.0, 20_000), ("hard", 0.05, 0.5, 20_000)],
)
def test_simulated_pixels_agree(reset, share: float, overlap: float, bits: int) -> None:
    channel = PixelChannel(reset, Q, (1.4 + share) * Q, share * Q, overlap)
    rate = sum(charge_errors(channel)) / 2
    errors = charge_trials(channel, bits, 1, 7)
    low, high = clopper_pearson(errors, bits, 1 - 1e-6)
    assert errors > 100 and low < rate < high


def test_simulated_slots_agree() -> None:
    p01, p10 = poisson_threshold(20, 26.0, 12.0)
    errors = poisson_trials(20, 26.0, 12.0, 100_000, 1, 3)
    low, high = clopper_pearson(errors, 100_000, 1 - 1e-6)
    assert low < (p01 + p10) / 2 < high


class TestCells:
    def test_one_pixel_and_tick_is_the_equations(self) -> None:
        for reset in ("hard", "residual"):
            exact = charge_errors(PixelChannel(reset, Q, 150.0, 10.0))
            assert pixel_errors(Q, 150.0, 10.0, reset, longest=None) == pytest.approx(
                exact, rel=1e-6
            )

    def test_residual_is_mended_by_a_cell_or_by_ticks(self) -> None:
        """The slicer .0507, 2 x 2 pixels 4.5e-5 and two ticks below 1e-6 in a simulation."""

        def rate(ticks: int, pixels: int) -> float:
            return sum(pixel_errors(Q, 150.0, 10.0, "residual", ticks, pixels)) / 2

        assert rate(1, 1) == pytest.approx(0.05, rel=1e-4)
        assert rate(1, 4) == pytest.approx(5e-5, rel=0.01)
        assert rate(2, 1) < 1e-6

    def test_two_ticks_simulated(self) -> None:
        """The count of spikes in two ticks at a weak ON level: independent pixels."""
        q, on, off, n = 20, 24.0, 3.0, 40_000
        rng = np.random.Generator(np.random.Philox(key=[1, 5]))
        charge = rng.integers(0, q, n)
        sent = rng.random((24, n)) < 0.5
        for row in sent:
            count = np.zeros(n, int)
            for _ in range(2):
                charge = charge + rng.poisson(np.where(row, on, off))
                count += charge >= q
                charge %= q
        p01, p10 = pixel_errors(q, on, off, "residual", 2, 1, longest=None)
        for wrong, of, p in (
            (int((count[~row] >= 2).sum()), int((~row).sum()), p01),
            (int((count[row] < 2).sum()), int(row.sum()), p10),
        ):
            low, high = clopper_pearson(wrong, of, 1 - 1e-6)
            assert low <= p <= high
        assert p10 > 0.05

    def test_majority_takes_more_than_half(self) -> None:
        p01, _ = pixel_errors(Q, 150.0, 10.0, "residual", 1, 3, rule="majority")
        assert p01 == pytest.approx(3 * 0.1**2 * 0.9 + 0.1**3, rel=1e-4)

    def test_a_large_threshold_is_scaled_down(self) -> None:
        assert pixel_errors(5000, 7000.0, 500.0) == pixel_errors(1000, 1400.0, 100.0)

    def test_nonsense_is_refused(self) -> None:
        with pytest.raises(ValueError, match="at least 1"):
            pixel_errors(100, 140, 0, ticks=0)


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match="no run is too long"):
        longest_off_run(100, 0)
    with pytest.raises(ValueError, match="overlap"):
        charge_errors(PixelChannel("hard", 10, 14, 1, 2))
    with pytest.raises(ValueError, match="subtract"):
        charge_errors(PixelChannel("subtract", 10, 14, 1, 0.5))
    with pytest.raises(ValueError, match="states"):
        charge_kernels("hard", 100_000, 1.0)
