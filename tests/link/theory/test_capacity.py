"""Capacities: tables, closed forms against a search, Blahut and Arimoto, forward recursion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import entr

from link.theory import count_capacity, one_bit_capacity, poisson_capacity
from link.theory.capacity import binary_capacity, poisson_best_duty
from link.theory.information import fsc_information_rate


def entropy(p):
    """Binary entropy, bits."""
    return (entr(p) + entr(1 - p)) / np.log(2)


@pytest.mark.parametrize(
    ("dark", "bits", "half"),
    [
        (0, 0.531, 5e-4),
        (0.01, 0.494, 5e-4),
        (0.1, 0.361, 5e-4),
        (1, 0.123, 5e-4),
        (10, 0.0172, 5e-5),
    ],
)
def test_bits_per_peak_photon(dark: float, bits: float, half: float) -> None:
    assert float(poisson_capacity(dark)) == pytest.approx(bits, abs=half)


def test_poisson_limits() -> None:
    assert float(poisson_capacity(0)) == pytest.approx(1 / np.e / np.log(2), rel=1e-14)
    assert (
        float(poisson_best_duty(0)) == pytest.approx(1 / np.e) and poisson_best_duty(1e300) == 0.5
    )
    # A strong background makes it Gaussian: A / (8 s) nats.
    assert float(poisson_capacity(1e12)) * 1e12 == pytest.approx(1 / 8 / np.log(2), rel=1e-9)
    # A mean limited to m: m ln(1/m) nats without background.
    assert float(poisson_capacity(0, 0.01)) == pytest.approx(0.01 * np.log(100) / np.log(2))
    with pytest.raises(ValueError, match="at least 0"):
        poisson_capacity(-1)


@pytest.mark.parametrize("dark", [0.003, 0.7, 20.0])
def test_the_duty_is_the_best_one(dark: float) -> None:
    best = float(poisson_best_duty(dark))
    for duty in np.linspace(0.02, best, 7):
        assert poisson_capacity(dark, duty) <= poisson_capacity(dark) * (1 + 1e-12)
    q = np.linspace(1e-3, 0.999, 4001)  # the bracket itself, as published
    s = dark
    rate = q * (1 + s) * np.log(1 + s) + (1 - q) * s * np.log(s) - (q + s) * np.log(q + s)
    assert q[rate.argmax()] == pytest.approx(best, abs=1e-3)
    assert rate.max() / np.log(2) == pytest.approx(float(poisson_capacity(s)), rel=1e-6)


@pytest.mark.parametrize(
    ("q", "row"),
    [
        (1, (0.44, 0.50, 0.59, 0.71)),
        (10, (0.36, 0.57, 0.82, 0.98)),
        (100, (0.33, 0.91, 1.00, 1.00)),
        (1000, (0.33, 1.00, 1.00, 1.00)),
    ],
)
def test_one_bit_slots(q: int, row: tuple[float, ...]) -> None:
    levels = np.array([1.0, 1.2, 1.5, 2.0])
    assert one_bit_capacity(q, levels * q) == pytest.approx(np.array(row), abs=0.0051)


def test_binary_channels() -> None:
    bits, share = binary_capacity(0.11, 0.11)
    assert float(bits) == pytest.approx(1 - float(entropy(0.11))) and share == pytest.approx(0.5)
    assert float(binary_capacity(0.0, 0.5)[0]) == pytest.approx(np.log2(1.25))  # the Z channel
    assert binary_capacity(0, 0)[0] == 1 and binary_capacity(0.3, 0.7)[0] == 0
    assert binary_capacity(1, 1)[0] == 1  # it says the opposite, always
    with pytest.raises(ValueError, match="0 to 1"):
        binary_capacity(1.1, 0)


@pytest.mark.parametrize(("p01", "p10"), [(0.01, 0.3), (0.2, 0.05), (1e-9, 0.9)])
def test_the_closed_form_is_the_maximum(p01: float, p10: float) -> None:
    bits, share = binary_capacity(p01, p10)
    a = np.linspace(0, 1, 20_001)
    told = entropy(a * (1 - p10) + (1 - a) * p01) - a * entropy(p10) - (1 - a) * entropy(p01)
    assert told.max() == pytest.approx(float(bits), rel=1e-6)
    assert a[told.argmax()] == pytest.approx(float(share), abs=2e-3)
    laws = np.array([[1 - p01, p01], [p10, 1 - p10]])
    found, of = count_capacity(laws[0], laws[1])
    assert found == pytest.approx(float(bits), rel=1e-9) and of == pytest.approx(
        float(share), abs=1e-6
    )


class TestForwardRecursion:
    def test_a_residual_pixel_carries_three_quarters_of_a_bit(self) -> None:
        """.77 bit a tick at Q = 100, a tenth of Q of background."""
        rate = fsc_information_rate("residual", 100, 150.0, 10.0, ticks=12_800)
        assert rate.low < 0.775 < rate.high and rate.high - rate.low < 0.02
        assert rate.rate == pytest.approx(0.77, abs=0.01)

    def test_a_pixel_of_one_electron_has_no_memory(self) -> None:
        """Its charge is always 0, so the rate is that of a binary channel with random input."""
        on, off = 2.0, 0.3
        p01, p10 = -np.expm1(-off), np.exp(-on)
        due = entropy((1 - p10 + p01) / 2) - (entropy(p10) + entropy(p01)) / 2
        rate = fsc_information_rate("residual", 1, on, off, ticks=640)
        assert rate.rate == pytest.approx(float(due), rel=1e-9)  # every tick says the same

    def test_full_light_tells_everything_and_equal_light_nothing(self) -> None:
        assert fsc_information_rate("hard", 20, 60.0, 0.0, ticks=640).rate == pytest.approx(
            1, abs=1e-6
        )
        assert fsc_information_rate("residual", 20, 9.0, 9.0, ticks=640).rate == pytest.approx(
            0, abs=1e-9
        )

    def test_memory_known_is_no_loss(self) -> None:
        """What is carried over is known in part from the spikes: more than the slicer's rate."""
        from link.theory import PixelChannel, charge_errors

        p01, p10 = charge_errors(PixelChannel("residual", 100, 150.0, 10.0))
        slicer = entropy((1 - p10 + p01) / 2) - (entropy(p10) + entropy(p01)) / 2
        assert fsc_information_rate("residual", 100, 150.0, 10.0, ticks=6400).low > slicer

    def test_a_seed_is_a_result(self) -> None:
        a, b = (fsc_information_rate("subtract", 10, 15.0, 1.0, ticks=640, seed=4) for _ in "ab")
        assert a == b and 0 < a.low < a.rate < a.high < 1

    def test_nonsense_is_refused(self) -> None:
        with pytest.raises(ValueError, match="ticks at least 320"):
            fsc_information_rate("hard", 10, 14.0, 0.0, ticks=10)
