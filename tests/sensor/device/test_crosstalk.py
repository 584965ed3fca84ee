"""Optical cross-talk against its point response and its transfer function.

Response of pixels under colour filters against an independent quadrature and against limits.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import constants, integrate

from cosim import PS, Block, Clock, Light, Piece, Summary
from cosim.compute.opencl import Device
from cosim.light.radiometry import luminous_curve
from cosim.spikes.viform import count_spikes
from sensor import CHIPS, CameraSetting, SpikeCamera
from sensor.device import crosstalk
from sensor.device.crosstalk import absorbed, crosstalk_map, filter_array, response, side_share
from sensor.latched.effects import RESIDUAL
from sensor.latched.effects.initial_charge import INITIAL_CHARGE


def mapped(plane: np.ndarray, crosstalk: float) -> np.ndarray:
    level = plane.astype(np.float32)
    return crosstalk_map(crosstalk)(Light((Piece(0, PS, level, level),))).pieces[0].first


def test_a_point_becomes_the_nine_numbers() -> None:
    point = np.zeros((5, 5))
    point[2, 2] = 1
    a = side_share(0.19)
    assert a == pytest.approx(0.05)  # 0.9^2 = 1 - 0.19
    line = np.array([0, a, 1 - 2 * a, a, 0])
    assert np.allclose(mapped(point, 0.19), np.outer(line, line), atol=1e-7)


@pytest.mark.parametrize("periods", [(0, 9), (7, 0), (11, 5), (32, 32)])
def test_the_transfer_function_of_a_sine(periods: tuple[int, int]) -> None:
    # Whole periods on the inner 64 x 64 of a wider plane, so that no border is seen.
    n, crosstalk = 64, 0.1
    y, x = np.mgrid[-1 : n + 1, -1 : n + 1] * (2 * np.pi / n)
    wave = 1 + np.cos(periods[0] * y) * np.cos(periods[1] * x)
    a = side_share(crosstalk)
    response = np.prod([1 - 2 * a * (1 - np.cos(2 * np.pi * p / n)) for p in periods])
    assert 0.5 < response < 0.99
    found = mapped(wave, crosstalk)[1:-1, 1:-1]
    assert np.allclose(found, (1 + (wave - 1) * response)[1:-1, 1:-1], atol=1e-6)


def test_uniform_light_stays_to_the_last_bit_and_none_is_lost() -> None:
    level = np.full((7, 9), 0.1234567, np.float32)
    assert np.array_equal(mapped(level, 0.3), level)
    field = np.zeros((20, 20))
    field[3:-3, 3:-3] = np.random.default_rng(1).random((14, 14))
    spread = mapped(field, 0.3)
    assert spread.sum(dtype=np.float64) == pytest.approx(field.sum(), rel=1e-6)
    assert (spread >= 0).all() and not np.allclose(spread, field, atol=0.01)


def test_the_camera_gathers_what_its_neighbours_lose(device: Device) -> None:
    # Columns alternate between bright and dark: the difference shrinks by 1 - 4a.
    clock, crosstalk, cycles = Clock(40_000), 0.1, 640
    plain = CameraSetting(CHIPS["spikeone"], clock, 300.0, 1, effects=(RESIDUAL, INITIAL_CHARGE))
    setting = CameraSetting(
        CHIPS["spikeone"], clock, 300.0, 1, effects=plain.effects, crosstalk=crosstalk
    )
    lux = np.where(np.arange(400) % 2, 0.6, 0.1) / setting.rate(1.0)
    level = np.broadcast_to(lux, (250, 400)).astype(np.float32)
    light = Light((Piece(0, PS, level, level),))
    response = 1 - 4 * side_share(crosstalk)
    for form, expected in ((plain, 0.5), (setting, 0.5 * response)):
        stream = SpikeCamera(form, device).step(light, Block(0, cycles))
        rates = count_spikes(stream, 0, cycles)[:, 2:-2].mean(axis=0) / cycles
        # The phases are uniform: a count is off by less than a spike, a mean over 250 rows by far
        # less.
        assert rates[1::2].mean() - rates[::2].mean() == pytest.approx(expected, abs=1e-4)


def test_the_bound_is_met_by_a_dark_pixel_among_bright_ones() -> None:
    dark, bright, crosstalk = 2.0, 50.0, 0.05
    field = np.full((3, 3), bright)
    field[1, 1] = dark
    error = mapped(field, crosstalk)[1, 1] / dark - 1
    setting = CameraSetting(
        CHIPS["spikeone"], Clock(40_000), 100.0, 1, effects=(), crosstalk=crosstalk
    )
    (effect,) = setting.acting_effects
    bound = effect.bound(Summary(dark, bright, 100.0, 41, 100))
    # The light's own share; that the latch may clip a spike near a threshold a cycle comes on top,
    # and noise, which makes an estimate of it.
    assert error == pytest.approx(bound.value, rel=1e-5) and bound.kind == "proof"
    noisy = effect.bound(Summary(dark, bright, 100.0, 41, 100, spread=0.1))
    assert noisy.kind == "estimate" and noisy.value > bound.value


@pytest.mark.parametrize(
    ("nm", "per_cm"), [(400, 9.52e4), (500, 1.11e4), (600, 4.14e3), (700, 1.90e3), (800, 8.50e2)]
)
def test_silicon_absorbs_as_published(nm: float, per_cm: float) -> None:
    """Half of the light in ln 2 over the absorption."""
    assert absorbed(nm, math.log(2) / per_cm * 1e4) == pytest.approx(0.5, rel=1e-12)


def test_the_response_is_the_integral() -> None:
    """By adaptive quadrature, with the photons per lumen from the constants of the SI."""
    depth, counted_at = 2.0, 550.0

    def gauss(nm: float, middle: float, spread: float) -> float:
        return math.exp(-(((nm - middle) / spread) ** 2) / 2)

    def quad(f: object) -> float:
        return float(integrate.quad(f, 380, 780, limit=400, epsrel=1e-9)[0])

    def curve(nm: float) -> float:
        return float(luminous_curve(np.array([nm]))[0])

    def energy(nm: float) -> float:
        return constants.h * constants.c / (nm * 1e-9)

    at = np.array([counted_at])
    base = 1 / (683 * curve(counted_at) * energy(counted_at)) * float(absorbed(at, depth)[0])
    expected = np.empty((3, 3))
    for column, share in enumerate((0.2126, 0.7152, 0.0722)):
        primary = crosstalk._PRIMARIES[column]
        lumens = 683 * quad(lambda nm, p=primary: gauss(nm, *p) * curve(nm))
        for row, (middle, spread, most) in enumerate(crosstalk._DYES):
            signal = quad(
                lambda nm, p=primary, m=middle, s=spread, t=most: (
                    gauss(nm, *p) / energy(nm) * t * gauss(nm, m, s)
                    * float(absorbed(np.array([nm]), depth)[0])
                )
            )  # fmt: skip
            expected[row, column] = share * signal / lumens / base
    np.testing.assert_allclose(response(depth, counted_at), expected, rtol=2e-3)


def test_each_colour_sees_its_own_primary_most() -> None:
    made = response(3.0, 550.0)
    assert (made > 0).all()
    np.testing.assert_array_equal(made.argmax(axis=0), [0, 1, 2])
    np.testing.assert_array_equal(made.argmax(axis=1), [0, 1, 2])


def test_thin_silicon_loses_red_first() -> None:
    """Red light goes deeper: its share of the response grows with depth."""
    thin, thick = response(0.5, 550.0), response(10.0, 550.0)
    assert thick[0, 0] / thick[2, 2] > 2 * thin[0, 0] / thin[2, 2]


def test_an_array_has_the_response_of_its_chip() -> None:
    array = filter_array("gbrg", 3.0, 550.0)
    np.testing.assert_array_equal(array.response, response(3.0, 550.0))
    assert array.matrix.sum(axis=1).max() == pytest.approx(1)
