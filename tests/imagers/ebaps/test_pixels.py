"""EBAPS pixels against their closed forms; what can be seen and what cannot."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats

from imagers.ebaps.pixels import (
    Chart,
    EbapsPixels,
    contrast_to_noise,
    recognisable,
    smallest_bar,
    wanted_exposure,
)
from imagers.ebaps.pixels.contrast import ROSE
from imagers.ebaps.pixels.silicon import Silicon
from imagers.ebaps.pixels.tube import PAIR_ENERGY, Tube
from sensor.frame_pixels import Exposed

Z = stats.norm.isf(0.5e-6)
"""Two-sided 1e-6."""
SHAPE = (96, 128)
N = SHAPE[0] * SHAPE[1]
PATTERNS = frozenset({"DSNU", "offset FPN", "PRNU", "stripes"})
WIDE = Silicon(dn_per_electron=2.0)
"""So little gain that nothing reaches the end of the scale."""
SECONDS = 0.03


def lux_seconds(electrons: float) -> float:
    """Light that gives so many photoelectrons a pixel."""
    return electrons / EbapsPixels().photoelectrons(1.0)


def shoot(
    pixels: EbapsPixels, light: npt.ArrayLike, kept: frozenset[str], seconds: float = SECONDS,
    frame: int = 0, seed: int = 3,
) -> npt.NDArray[np.float64]:  # fmt: skip
    height = pixels.shape[0]
    plane = np.broadcast_to(np.asarray(light, float), pixels.shape).copy()
    rows = Exposed(plane, np.full(height, seconds), np.zeros(height), 0, frame)
    return pixels.convert(rows, seed, kept).astype(float)


def agrees(values: npt.NDArray[np.float64], mean: float, variance: float) -> None:
    """Sample mean and variance, each at 1e-6; the variance's own spread from the fourth moment."""
    n = values.size
    assert abs(values.mean() - mean) < Z * math.sqrt(variance / n)
    fourth = ((values - values.mean()) ** 4).mean()
    assert abs(values.var(ddof=1) - variance) < Z * math.sqrt((fourth - variance**2) / n)


class TestTube:
    def test_light_becomes_electrons(self) -> None:
        tube = Tube()
        assert tube.electrons_per_lux == pytest.approx(1.19e16, rel=2e-3)
        assert tube.quantum_efficiency == pytest.approx(1.19e16 / 4.09e15, rel=5e-3)
        emission = tube.emission_lux * tube.electrons_per_lux * Silicon().area
        assert emission == pytest.approx(0.35, abs=0.01)  # electrons a second in a pixel

    @pytest.mark.parametrize(("volts", "low", "high"), [(1000, 110, 156), (1500, 219, 267)])
    def test_gain(self, volts: float, low: float, high: float) -> None:
        """Within what V_d of 300 to 500 V gives; far above the edge it is the straight line."""
        tube = Tube()
        line = tube.collection * (volts - tube.threshold) / PAIR_ENERGY
        assert tube.gain(volts) == pytest.approx(line, rel=1e-3)
        assert low <= line <= high
        for edge in (300, 500):
            assert low - 1 <= replace(tube, threshold=edge).gain(volts) <= high

    def test_no_voltage_no_gain_and_no_sharp_edge(self) -> None:
        tube = Tube()
        assert tube.gain(0) == 0
        gains = np.array([tube.gain(v) for v in range(0, 1501, 10)])
        assert (np.diff(gains) > 0).all() and (np.diff(gains, 2) > -1e-9).all()
        half = tube.collection * tube.softness * math.log(2) / PAIR_ENERGY
        assert tube.gain(tube.threshold) == pytest.approx(half, rel=2e-3)

    def test_excess_noise(self) -> None:
        """F^2 = n var/mean^2 of the electrons from n photoelectrons: 1/(1 - eta_b), plus a small
        term from the variance of the gain; and more from bursts of ions."""

        def excess(tube: Tube) -> float:
            budget = EbapsPixels(volts=1500, tube=tube).budget(1.0, 0.0)
            relative = float(budget.tube_variance) / float(budget.tube_mean(budget.light)) ** 2
            return budget.light * relative

        tube = Tube()
        assert excess(replace(tube, ions=0.0)) == pytest.approx(1 / (1 - tube.loss), rel=2e-3)
        q, b = tube.ions, tube.burst
        more = 1 + q * b
        square = more**2 + q * b * (2 * b + 1) + more * tube.gain_variance / tube.gain(1500)
        assert excess(tube) == pytest.approx(square / (more**2 * (1 - tube.loss)))
        assert excess(tube) > 1.3 * excess(replace(tube, ions=0.0))

    def test_landing_radius(self) -> None:
        assert Tube().landing_radius(1500) == pytest.approx(2.4e-6, rel=0.03)

    @pytest.mark.parametrize("volts", [20.0, 300.0, 1500.0])
    def test_landing_kernel_is_the_spread_of_a_pixel(self, volts: float) -> None:
        """Its variance is that of a uniform pixel binned again (1/6) plus the spread's."""
        tube, pitch = Tube(), 10.8e-6
        kernel = tube.landing_kernel(volts, pitch)
        shares = np.concatenate([kernel[:0:-1], kernel])
        assert shares.sum() == pytest.approx(1) and (shares >= 0).all()
        places = np.arange(shares.size) - kernel.size + 1
        drawn = np.random.default_rng(1)
        x = drawn.uniform(-0.5, 0.5, 200_000)
        x = x + drawn.normal(0, tube.landing_spread(volts) / pitch, x.size)
        for place, share in zip(places, shares, strict=True):
            seen = int((np.rint(x) == place).sum())
            assert stats.binomtest(seen, x.size, min(share, 1.0)).pvalue > 1e-6

    def test_without_transverse_energy_all_land_where_they_start(self) -> None:
        kernel = Tube(transverse=0.0).landing_kernel(1500, 1e-5)
        assert kernel[0] == 1 and not kernel[1:].any()


class TestPixels:
    @pytest.mark.parametrize("volts", [0.0, 700.0, 1500.0])
    @pytest.mark.parametrize("electrons", [0.0, 0.7, 6.0, 60.0])
    def test_mean_and_variance(self, volts: float, electrons: float) -> None:
        # Ions come so often that a frame has enough of them for its variance to be normal.
        tube = replace(Tube(), ions=1 / 30 if electrons else 0.0)
        silicon = replace(WIDE, dn_per_electron=0.7, well=1e6)
        pixels = EbapsPixels(SHAPE, volts=volts, silicon=silicon, tube=tube)
        kept = frozenset(pixels.effects) - PATTERNS
        light = lux_seconds(electrons)
        agrees(shoot(pixels, light, kept), *pixels.mean_variance(light, SECONDS))

    @pytest.mark.parametrize("left_out", sorted(set(EbapsPixels().effects) - PATTERNS))
    def test_each_effect_left_out(self, left_out: str) -> None:
        """What goes is what the budget says of it, and no more than the bound."""
        pixels = EbapsPixels(SHAPE, silicon=replace(WIDE, leakage=1e-2))
        light = lux_seconds(6.0)
        kept = frozenset(pixels.effects) - PATTERNS - {left_out}
        mean, variance = pixels.mean_variance(light, SECONDS)
        k = WIDE.dn_per_electron
        part = pixels.budget(light, SECONDS).parts().get(left_out)
        new_mean = mean - (part.mean * k if part else 0.0)
        new = variance - (part.variance * k * k if part else 0.0)
        agrees(shoot(pixels, light, kept), new_mean, new)
        summary = pixels.summary((light, light), (SECONDS, SECONDS), 1)
        bound = pixels.effects[left_out].bound(summary)
        change = max(abs(new_mean - mean) / (mean - WIDE.black), abs(math.sqrt(new / variance) - 1))
        assert float(bound.value) >= change * (1 - 1e-9)
        assert bound.kind == "proof"

    def test_ions_are_rare_and_large(self) -> None:
        """An event in 600 electrons that land, each of a geometric number (from 0) of mean 10."""
        pixels = EbapsPixels(SHAPE, silicon=WIDE)
        only = shoot(pixels, lux_seconds(6.0), frozenset({"ion events"})) - WIDE.black
        gain = pixels.tube.gain(1500) * WIDE.dn_per_electron
        steady = 6.0 * (1 - pixels.tube.loss) * gain
        bursts = (only - steady) / gain
        rate = 6.0 * (1 - pixels.tube.loss) * pixels.tube.ions
        events = stats.binomtest(int((bursts > 0.5).sum()), N, rate * 10 / 11)
        assert events.pvalue > 1e-6  # an event of k = 0 cannot be seen

    def test_noise_of_neighbours_is_not_correlated(self) -> None:
        """Each electron lands by itself: spreading the means is the exact law."""
        pixels = EbapsPixels(SHAPE, silicon=WIDE)
        kept = frozenset(pixels.effects) - PATTERNS
        values = shoot(pixels, lux_seconds(6.0), kept)
        a, b = values[:, :-1].ravel(), values[:, 1:].ravel()
        assert abs(np.corrcoef(a, b)[0, 1]) < Z / math.sqrt(a.size)

    def test_landing_and_halo_keep_the_sum(self) -> None:
        """A bright point: its light comes down around it, all of it."""
        pixels = EbapsPixels((129, 129), silicon=WIDE)
        point = np.zeros(pixels.shape)
        point[64, 64] = lux_seconds(3000.0)  # 720 electrons in the whole of the halo's disc
        plain = shoot(pixels, point, frozenset()) - WIDE.black
        assert (plain > 0).sum() == 1 and plain.max() == 2 * WIDE.well
        point /= 60.0
        whole = (shoot(pixels, point, frozenset()) - WIDE.black).sum()
        near = shoot(pixels, point, frozenset({"landing spread"})) - WIDE.black
        assert near.sum() == pytest.approx(whole, abs=9)  # rounding of nine pixels
        assert near[64, 64] / whole == pytest.approx(pixels.kernel[0] ** 2, rel=1e-3)
        point *= 50.0
        fine = replace(WIDE, dn_per_electron=100.0, well=1e9)
        pixels = EbapsPixels((129, 129), silicon=fine)
        far = shoot(pixels, point, frozenset({"halo"})) - fine.black
        far[64, 64] = 0
        radius = pixels.tube.halo_radius / fine.pitch
        away = np.hypot(*np.mgrid[-64:65, -64:65])
        landed = 2500.0 * (1 - pixels.tube.loss) * pixels.tube.gain(1500) * 100
        assert far.sum() == pytest.approx(landed * pixels.tube.halo, rel=0.005)
        assert far[away > radius + 5].sum() == 0

    def test_dark_current_doubles(self) -> None:
        warm = EbapsPixels(SHAPE, volts=0, kelvin=306.5, silicon=WIDE)
        cold = warm.at(kelvin=300.0)
        assert warm.silicon.dark_rate(306.5) == pytest.approx(2 * WIDE.dark)
        kept = frozenset({"dark current", "silicon shot noise", "read noise"})
        for pixels in (warm, cold):
            agrees(shoot(pixels, 0.0, kept), *pixels.mean_variance(0.0, SECONDS))

    def test_patterns_have_their_sizes_and_stay(self) -> None:
        pixels = EbapsPixels(SHAPE, silicon=WIDE)
        assert pixels.at(volts=3.0).pattern is pixels.pattern
        other = EbapsPixels(SHAPE, silicon=WIDE, device=2)
        assert (other.pattern.dark() != pixels.pattern.dark()).mean() > 0.99
        dark = pixels.pattern.dark()
        assert abs(dark.mean() - 1) < Z * WIDE.dsnu / math.sqrt(N)
        assert dark.std() == pytest.approx(WIDE.dsnu, rel=0.05) and (dark > 0).all()
        assert pixels.pattern.response().std() == pytest.approx(WIDE.prnu, rel=0.04)
        # 96 rows and 128 columns: chi-square of so many at 1e-6 is within a half.
        assert pixels.pattern.stripes().std() == pytest.approx(WIDE.stripes, rel=0.5)
        rows = pixels.pattern.offset().mean(axis=1)
        assert rows.std() == pytest.approx(
            math.hypot(WIDE.row_offset, WIDE.offset / math.sqrt(128)), rel=0.5
        )

    def test_dsnu_grows_with_exposure_and_offsets_do_not(self) -> None:
        pixels = EbapsPixels(SHAPE, silicon=WIDE)
        k = WIDE.dn_per_electron
        for seconds in (0.01, 0.5):
            got = shoot(pixels, 0.0, frozenset({"dark current", "DSNU"}), seconds)
            spread = WIDE.dsnu * WIDE.dark * seconds * k
            assert got.std() == pytest.approx(spread, rel=0.06)
        a = shoot(pixels, 0.0, frozenset({"offset FPN"}), 0.01)
        assert (a == shoot(pixels, 0.0, frozenset({"offset FPN"}), 0.5)).all()

    def test_well_and_converter_end_it(self) -> None:
        small = EbapsPixels(SHAPE, silicon=replace(WIDE, well=1000.0))
        assert shoot(small, lux_seconds(1e4), frozenset()).max() == WIDE.black + 2000
        assert shoot(EbapsPixels(SHAPE), lux_seconds(1e6), frozenset()).min() == 65_535

    def test_bands_of_a_frame_do_not_change_its_draws(self) -> None:
        pixels = EbapsPixels(SHAPE)
        kept = frozenset(pixels.effects) - {"landing spread", "halo"}
        light = np.full(SHAPE, lux_seconds(6.0))
        whole = shoot(pixels, light, kept)
        times = np.full(40, SECONDS)
        part = pixels.convert(Exposed(light[30:70], times, 0 * times, 30, 0), 3, kept)
        assert (part == whole[30:70]).all()

    def test_where_the_scale_clips_bounds_are_estimates(self) -> None:
        pixels = EbapsPixels(SHAPE)
        summary = pixels.summary((lux_seconds(1), lux_seconds(90)), (0.001, 0.03), 10)
        assert {e.bound(summary).kind for e in pixels.effects.values()} == {"estimate"}
        assert all(e.cost(summary) > 0 for e in pixels.effects.values())

    def test_nonsense_is_refused(self) -> None:
        for wrong in (
            lambda: Tube(loss=1.0), lambda: Tube(gap=0), lambda: Tube(ions=-1),
            lambda: Silicon(pitch=0), lambda: Silicon(dark=math.nan), lambda: Silicon(prnu=-1),
            lambda: EbapsPixels(volts=-1), lambda: EbapsPixels(kelvin=0),
        ):  # fmt: skip
            with pytest.raises(ValueError, match="must"):
                wrong()


class TestBrightness:
    def test_equation_1_gives_the_mean_signal(self) -> None:
        """Y = k E (D/f)^2 T G of document 002, equation 1, against the pixels' closed form. k is
        the product of the optics (rho T_l/4), the photocathode (electrons per lux second) and the
        analog chain (DN per electron)."""
        lux, seconds = 3e-3, 0.02
        for volts in (800.0, 1500.0):
            pixels = EbapsPixels(volts=volts, silicon=replace(Silicon(), leakage=0.0))
            tube = replace(pixels.tube, emission_lux=0.0)
            pixels = replace(pixels, tube=tube)
            absorbed = pixels.budget(1.0, 0.0).light * (1 - tube.loss)  # electrons / (lx s)
            multiplied = absorbed * (1 + tube.ions * tube.burst)
            k = 0.5 * 0.9 / 4 * multiplied * pixels.silicon.dn_per_electron
            said = k * lux * (1 / 1.4) ** 2 * seconds * tube.gain(volts)
            plane = lux * 0.5 * 0.9 / (4 * 1.4**2)
            mean = pixels.mean_variance(plane * seconds, seconds)[0]
            none = pixels.mean_variance(0.0, seconds)[0]
            assert said == pytest.approx(mean - none, rel=1e-9)

    def test_the_target_is_reached_where_the_document_shows_an_image(self) -> None:
        plane = sum(Chart(3e-3).plane) / 2
        seconds = wanted_exposure(EbapsPixels(), plane, 24_800)
        assert 9.92e-3 < seconds < 32.768e-3
        assert EbapsPixels().budget(plane * seconds, 0.0).response * 20 == pytest.approx(24_800)


def bars(chart: Chart, shape: tuple[int, int], width: int) -> npt.NDArray[np.float64]:
    """(H, W) lux: upright bars, bright and dark in turn, over the whole plane."""
    bright, dark = chart.plane
    return np.broadcast_to(np.where(np.arange(shape[1]) // width % 2, dark, bright), shape).copy()


class TestContrast:
    def test_what_the_document_saw(self) -> None:
        """A chart at 3e-3 lx with -1500 V; nothing at 3e-1 lx with 0 V, however large."""
        pixels = EbapsPixels()
        chart = Chart(3e-3)
        seconds = wanted_exposure(pixels, sum(chart.plane) / 2, 24_800)
        assert contrast_to_noise(pixels, chart, seconds) > 20
        assert recognisable(pixels, chart, seconds)
        fine = smallest_bar(pixels, chart, seconds)
        assert fine is not None and fine < 2
        off, brighter = pixels.at(volts=0.0), Chart(3e-1)
        assert contrast_to_noise(off, brighter, 32.768e-3) < 0.2
        assert not recognisable(off, brighter, 32.768e-3)
        assert smallest_bar(off, brighter, 32.768e-3) is None

    @pytest.mark.parametrize(("volts", "lux"), [(0.0, 3e-1), (1500.0, 3e-5), (1500.0, 3e-3)])
    def test_measured_on_frames(self, volts: float, lux: float) -> None:
        """Bars of 4 x 20 pixels in a corrected frame: the contrast over the scatter of their means
        is the closed form's, with the landing's loss at the sides only (bars have no ends here)."""
        shape, width, seconds = (160, 320), 4, 0.02
        pixels = EbapsPixels(shape, volts=volts, silicon=replace(WIDE, stripes=0.0))
        kept = frozenset(pixels.effects)
        chart = Chart(lux, width=width)
        light = bars(chart, shape, width) * seconds
        darks = [shoot(pixels, 0.0, kept, seconds, frame=n) for n in range(4)]
        live = shoot(pixels, light, kept, seconds, frame=4) - np.mean(darks, axis=0)
        # Mean of each bar of 4 x 20; columns of bars away from the sides.
        means = live.reshape(8, 20, 80, 4).mean(axis=(1, 3))[:, 8:-8]
        bright, dark = means[:, ::2], means[:, 1::2]
        variance = (bright.var(ddof=1) + dark.var(ddof=1)) / 2
        across = sum(k * s for k, s in enumerate(pixels.kernel))
        ends = 1 - 2 * across / (5 * width)
        said = contrast_to_noise(pixels, chart, seconds) / ends
        step = (bright.mean() - dark.mean()) / math.sqrt(variance)
        n = bright.size
        # Contrast's own scatter, and that of an estimated deviation, with room for the Poisson
        # and ion tails (fourth moment of a mean of 80).
        error = Z * math.sqrt(2 / n + step**2 / (2 * n))
        assert abs(step - said) < error
        # Told apart by its mean alone, bar by bar, against the middle: wrong in Phi(-CNR/2).
        middle = (bright.mean() + dark.mean()) / 2
        wrong = int((bright < middle).sum() + (dark > middle).sum())
        chance = stats.norm.sf(said / 2)
        if said < ROSE:
            assert stats.binomtest(wrong, 2 * n, chance).pvalue > 1e-6
        else:
            assert wrong == 0

    def test_offsets_count_where_no_darks_are_taken(self) -> None:
        pixels, chart = EbapsPixels(), Chart(3e-4)
        assert contrast_to_noise(pixels, chart, 0.03, darks=0) < contrast_to_noise(
            pixels, chart, 0.03, darks=10**9
        )

    def test_lost_light_is_lost_contrast(self) -> None:
        pixels = EbapsPixels()
        narrow, wide = Chart(3e-4, width=2.0), Chart(3e-4, width=8.0)
        ratio = contrast_to_noise(pixels, wide, 0.03) / contrast_to_noise(pixels, narrow, 0.03)
        assert ratio > 4  # sqrt of the area alone
