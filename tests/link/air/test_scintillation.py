"""Patches of the panel flicker as theory says that points apart do, and the bound of it holds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cosim import Block
from cosim.compute.streams import Stream
from link.air import Change, LinkSummary, ber
from link.air.motion import normal_draws
from link.air.scintillation import Flicker, FlickerSeries, Patches, aperture_averaging, patch_side
from link.air.summary import flicker_units
from tests.link.air.scenes import AIR, OPTICS, make

Z = 4.9
"""Normal deviations of alpha 1e-6."""
K = 2 * math.pi / 555e-9


def test_lens_and_source_may_change_places() -> None:
    """Reciprocity; a point's light at a point is 1; a wide source before a lens leaves D^(-7/3) of
    Churnside's limit for a point, as a wide lens before a source."""
    for lens, source in ((0.02, 0.004), (0.003, 0.05), (0.02, 0.3)):
        one = aperture_averaging(lens, 555.0, 10.0, source)
        assert aperture_averaging(source, 555.0, 10.0, lens) == pytest.approx(one, rel=0.02)
        assert one < aperture_averaging(lens, 555.0, 10.0)
    d2 = K * 3.0**2 / (4 * 10.0)
    assert aperture_averaging(0.0, 555.0, 10.0, 3.0) == pytest.approx(
        1 / (0.214 * d2 ** (7 / 6)), rel=0.05
    )


def test_a_source_of_two_points_has_the_covariance_of_the_path() -> None:
    """The disc's part is the mean of J0 over all pairs of its points: drawn pairs of the direct
    integral in metres, 8 pi^2 0.033 k^2 Cn2 int int K^(-8/3) (1 - cos) (lens)^2 J0(K s (1 - z / L))
    dK dz, z from the source."""
    from scipy.special import j0, j1

    length, lens, disc = 10.0, 0.02, 0.03
    rng = np.random.default_rng(4)
    radius = disc / 2 * np.sqrt(rng.random((400, 2)))
    points = radius * np.exp(2j * math.pi * rng.random((400, 2)))
    apart = np.abs(points[:, 0] - points[:, 1])
    z = (np.arange(120) + 0.5)[:, None] / 120 * length
    kappa = np.exp(np.linspace(math.log(1e-1), math.log(3e4), 800))
    x = np.maximum(kappa * lens * z / (2 * length), 1e-9)
    each = kappa ** (-5 / 3) * (1 - np.cos(kappa**2 * z * (length - z) / (K * length)))
    each = each * (2 * j1(x) / x) ** 2
    found = np.array([(each * j0(kappa * s * (1 - z / length))).sum() for s in apart])
    found /= each.sum()
    exact = aperture_averaging(lens, 555.0, length, disc) / aperture_averaging(lens, 555.0, length)
    error = float(found.std()) / math.sqrt(len(apart))
    assert abs(found.mean() - exact) < Z * error + 0.01 * exact
    assert error < 0.1 * exact


@pytest.mark.parametrize(("lens", "pixel"), [(0.0, 0.0), (0.02, 0.0), (0.02, 0.0025)])
def test_no_area_flickers_less_in_patches_than_in_theory(lens: float, pixel: float) -> None:
    """Over a disc of any area a, p^2 / a of the index and 1 at most; it is met at one area."""
    side = patch_side(lens, 555.0, 10.0, pixel)
    own = aperture_averaging(lens, 555.0, 10.0, pixel)
    zone = math.sqrt(555e-9 * 10.0)
    discs = max(lens, zone) * np.geomspace(0.3, 60, 30)
    left = np.array([aperture_averaging(lens, 555.0, 10.0, float(e)) for e in discs]) / own
    said = side**2 / (math.pi / 4 * discs**2)
    assert (left <= said * 1.005).all()
    assert (left / said).max() > 0.99
    if pixel == 0:
        known = 0.874 * zone if lens == 0 else 0.48 * lens
        assert side == pytest.approx(known, rel=0.03)
    else:
        assert side > patch_side(lens, 555.0, 10.0)


def test_patches_are_an_even_grid_no_finer_than_asked() -> None:
    grid = Patches((30, 70), 1e-3, 8e-3)
    assert grid.shape == (3, 8) and grid.count == 24
    factors = np.arange(24.0) + 1
    light = np.repeat(grid.columns(factors), np.diff(grid.bands), axis=0)
    assert light.shape == (30, 70)
    assert light[0, 0] == 1 and light[0, -1] == 8 and light[-1, -1] == 24 and light[10, 0] == 9
    seen, counts = np.unique(light, return_counts=True)
    assert np.array_equal(seen, factors) and counts.min() >= 80 and counts.max() <= 90
    assert Patches((30, 70), 1e-3, math.inf).shape == (1, 1)
    assert Patches((30, 70), 1e-3, 1e-5).shape == (30, 70)


@pytest.mark.parametrize("law", [Flicker(0.04, None, 2e-3), Flicker(0.706, (4.39, 2.56), 2e-3)])
def test_patches_have_the_law_of_one_and_nothing_in_common(law: Flicker) -> None:
    """Mean 1 and index over 20 000 patches; the log's course of each in time exp(-t / t_c), between
    neighbours none; the mean over patches has their variance over their number."""
    series, n = FlickerSeries(law, 1e-3, 20_000, 3), 20_000
    now, later = series[0], series[2]
    for x in (now, later):
        assert abs(x.mean() - 1) < Z * math.sqrt(law.index / n)
        fourth = ((x - 1) ** 4).mean() / law.index**2
        assert abs(x.var() / law.index - 1) < Z * math.sqrt((fourth - 1) / n)
    a, b = np.log(now), np.log(later)
    if law.shape is None:
        exact = math.exp(-1.0)
        assert abs(np.corrcoef(a, b)[0, 1] - exact) < Z * (1 - exact**2) / math.sqrt(n)
    else:
        assert np.corrcoef(a, b)[0, 1] > 0.3
    assert abs(np.corrcoef(a[:-1], a[1:])[0, 1]) < Z / math.sqrt(n)
    means = now.reshape(-1, 50).mean(axis=1)
    assert abs(means.var() * 50 / law.index - 1) < Z * math.sqrt(2.5 / len(means))


def test_a_patch_is_of_its_number_and_symbol_alone() -> None:
    """Whatever is asked for first, and however many there are; the first is the one of a panel of a
    single patch: Ornstein-Uhlenbeck of the draws of counter (patch, 0, symbol, 0)."""
    law = Flicker(0.04, None, 2e-3)
    many, few = FlickerSeries(law, 1e-3, 2000, 3), FlickerSeries(law, 1e-3, 7, 3)
    late = many[100].copy()
    assert np.array_equal(late[:7], few[100])
    assert np.array_equal(many[3][:7], few[3]) and np.array_equal(many[100], late)
    draws = normal_draws(3, Stream.SCINTILLATION, 5, 4)[:, 0]
    stays, variance, x = math.exp(-0.5), math.log1p(0.04), draws[0]
    for n in range(4):
        if n:
            x = stays * x + math.sqrt(1 - stays**2) * draws[n]
        exact = math.exp(math.sqrt(variance) * x - variance / 2)
        assert few[n][5] == pytest.approx(exact, rel=1e-12)
    assert not np.array_equal(FlickerSeries(law, 1e-3, 7, 4)[0], few[0])
    assert np.array_equal(FlickerSeries(Flicker(0.0, None, 1.0), 1e-3, 7, 4)[9], np.ones(7))
    with pytest.raises(IndexError, match="0 or more, not -1"):
        few[-1]


def test_light_through_patches_is_the_same_in_any_blocks() -> None:
    """Each patch times its own factor, on the camera too; blocks of 8 and 24 cycles, and going back
    to the first."""
    strong = replace(AIR, structure=1e-9, glare=0.0)
    optics = replace(OPTICS, blur=0.0, f_number=4.0)
    given: dict[str, Any] = {"air": strong, "optics": optics, "effects": ["scintillation"]}
    whole, parts = make(**given), make(**given)
    assert whole.patches.count >= 2
    long = whole.step(None, Block(0, 24)).pieces
    short = {p.start: p for n in (0, 8, 16) for p in parts.step(None, Block(n, 8)).pieces}
    assert all(np.array_equal(p.first, short[p.start].first) for p in long)
    again = parts.step(None, Block(0, 8)).pieces
    assert all(np.array_equal(p.first, short[p.start].first) for p in again)
    plain = make(**given | {"effects": []})
    (one,), (two,) = whole._made([2]), plain._made([2])
    lit = two.first > two.first.max() * 0.99
    found = one.first[lit] / two.first[lit]
    factors = whole.factors[2]
    near = np.abs(found[:, None] - factors).min(axis=1) < 1e-3
    assert near.mean() > 0.6  # the rest lies between patches
    assert len({int(np.abs(f - factors).argmin()) for f in found}) == whole.patches.count


def _scene(**changes: Any) -> LinkSummary:
    given: dict[str, Any] = {
        "darkest": 0.0, "brightest": 120.0, "threshold": 100.0, "window": 1, "cycles": 600,
        "on": 120.0, "off": 1.0, "bits": 10_000_000,
    }  # fmt: skip
    return LinkSummary(**given | changes)


def test_the_bound_is_a_linear_part_that_patches_average_and_a_quadratic_one_that_stays() -> None:
    """Against derivatives of the closed form: Poisson(x 120) below 100, B = (P + Q) / 2."""
    from scipy.stats import poisson

    def rate(x: float) -> float:
        on, off = 1 + 119 * x, 1.0
        return float(poisson.cdf(99, on) + poisson.sf(99, off)) / 2

    scene, index, h = _scene(), 1e-5, 1e-3
    law, times = Flicker(index, None, 1e-3), 40.0
    assert ber(scene) == pytest.approx(rate(1.0), rel=1e-9)
    slope = (rate(1 + h) - rate(1 - h)) / (2 * h)
    bend = (rate(1 + h) - 2 * rate(1.0) + rate(1 - h)) / h**2
    half = 3.29 * math.sqrt(rate(1.0) / scene.bits)  # normal, 99.9 %
    linear = 3.29 * abs(slope) * math.sqrt(index / times)
    assert flicker_units(scene, law, times) == pytest.approx(
        (bend * index / 2 + linear) / half, rel=0.01
    )
    assert flicker_units(scene, law, 1e12) == pytest.approx(bend * index / 2 / half, rel=0.01)
    one = Change(math.sqrt(index), 60.0, law)
    many = replace(one, patches=400)
    assert many.units(scene) < one.units(scene) / 10
    assert one.units(scene) == flicker_units(scene, law, 10.0)
    assert flicker_units(scene, Flicker(0.0, None, 1.0), 1.0) == 0
    # Deep fades of gamma-gamma cost more than log-normal ones of the same index.
    deep = flicker_units(scene, Flicker(0.706, (4.39, 2.56), 1e-3), 1e12)
    assert deep > 0.5 * (0.5 - rate(1.0)) * 0.2 / half


@pytest.mark.parametrize(
    "law", [Flicker(1e-4, None, 1e-3), Flicker(0.01, None, 1e-3), Flicker(0.25, (9.0, 9.0), 1e-3)]
)
def test_the_bound_holds_on_panels_of_flickering_patches(law: Flicker) -> None:
    """The rate of a run with flicker less that without, of 100 runs of 25 patches: given its light
    each bit errs as often as the closed form says, so all that is chance is the flicker. At 99.9 %
    within the bound (100 runs: no more than 4 outside, alpha 1e-6), and not by ten times."""
    from scipy.stats import poisson

    scene, symbols, seconds, patches = _scene(), 80, 187.5e-6, 25
    runs = np.empty(100)
    for seed in range(len(runs)):
        series = FlickerSeries(law, seconds, patches, seed)
        x = np.stack([series[n] for n in range(symbols)])
        on = poisson.cdf(99, 1 + 119 * x)
        runs[seed] = (on + poisson.sf(99, 1.0)).mean() / 2 - ber(scene)
    half = 3.29 * math.sqrt(ber(scene) / scene.bits)
    lasts = 2 * law.time / 25e-6
    most = Change(math.sqrt(law.index), lasts, law, patches).units(scene) * half
    assert (np.abs(runs) > most).sum() <= 4
    assert np.abs(runs).max() > most / 10
