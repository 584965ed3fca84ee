"""Three-transistor pixels against their closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from imagers.adaptive.pixels import AdaptivePixels, CmosSetting
from imagers.adaptive.pixels.effects import truncated
from sensor.frame_pixels import Exposed

EVEN = CmosSetting(dsnu=0.0, prnu=0.0, column=0.0)
Z = 4.9  # two-sided, alpha 1e-6


def exposed(
    lux_seconds: npt.ArrayLike, shape: tuple[int, int], seconds: float = 0.01, frame: int = 0
) -> Exposed:
    light = np.broadcast_to(np.asarray(lux_seconds, np.float64), shape)
    rows = shape[0]
    return Exposed(np.array(light), np.full(rows, seconds), np.zeros(rows), 0, frame)


def test_the_numbers_of_the_setting() -> None:
    """50 000 electrons a lux second; sqrt(2 k T C)/q with C = q / 20 uV = 8.01 fF at 300.15 K is
    50.9 electrons; dark current doubles in 6.5 K."""
    s = CmosSetting()
    assert s.sensitivity == pytest.approx(50_000)
    assert s.reset_noise == pytest.approx(50.87, abs=0.05)
    assert s.reset_noise**2 == pytest.approx(2 * 1.380649e-23 * 300.15 / (1.602177e-19 * 20e-6))
    warmer = replace(s, celsius=s.celsius + 6.5)
    assert warmer.dark_now == pytest.approx(2 * s.dark_now)
    assert replace(s, celsius=25.0).dark_now == 624.0
    assert s.step == pytest.approx(1 / 256 / 20e-6)
    assert replace(s, gain=2.0, well=60_000.0).volts(10, 0.01) == pytest.approx(0.2)


def test_the_converter_truncates_and_its_comparator_tells_saturation() -> None:
    s = CmosSetting()
    assert s.value(1e6, 1e-6) == (255, False)  # exactly full scale
    assert s.value(1.0001e6, 1e-6) == (255, True)
    assert s.value(0.1, 65.536e-3) == (1, False)
    assert s.value(0.0, 1.0) == (0, False) and s.value(math.inf, 1.0)[1]
    assert [s.digitised(k / 256)[0] for k in range(257)] == [*range(256), 255]


@pytest.mark.parametrize("volts", [0.13, 0.4, 0.77])
@pytest.mark.parametrize("seconds", [1e-6, 65.536e-3, 5.0])
def test_mean_and_variance_are_the_closed_form(volts: float, seconds: float) -> None:
    pixels = AdaptivePixels((256, 256), EVEN)
    lux_seconds = volts - min(volts / 2, EVEN.dark_now * seconds * EVEN.conversion)
    values = pixels.convert(
        exposed(lux_seconds, pixels.shape, seconds), 11, pixels.everything
    ).astype(float)
    mean, variance = pixels.mean_variance(lux_seconds, seconds)
    count = values.size
    assert 25 < mean < 230
    assert abs(values.mean() - mean) < Z * math.sqrt(variance / count)
    assert abs(values.var() - variance) < Z * variance * math.sqrt(2.2 / count)


def test_dim_values_follow_the_truncated_normal_law() -> None:
    """Below half a DN of noise the converter's steps show: mean and spread by `truncated`."""
    pixels = AdaptivePixels((256, 256), EVEN)
    for number, level in enumerate((0.0, 0.3, 0.5, 1.0, 2.6, 3.9)):
        light = level * EVEN.step / EVEN.sensitivity
        values = pixels.convert(
            exposed(light, pixels.shape, 1e-6, number), 12, pixels.everything
        ).astype(float)
        electrons = level * EVEN.step
        noise = (electrons + EVEN.reset_noise**2 + EVEN.read_noise**2) / EVEN.step**2
        mean, spread = truncated(np.array([level]), np.array([noise]))
        # a Poisson law's skewness moves a tail's share by about skewness/6 of the law's own spread
        slack = Z * spread[0] / 256 + 0.4 / math.sqrt(electrons + 1) / 6
        assert abs(values.mean() - mean[0]) < max(slack, 1e-3)
        assert values.min() >= 0


def test_saturation_and_well() -> None:
    pixels = AdaptivePixels((8, 8), replace(EVEN, well=52_000.0))
    values, saturated = pixels.digitise(
        exposed([1.2] * 4 + [0.9] * 4, (8, 8)), 1, pixels.everything
    )
    assert saturated[:, :4].all() and not saturated[:, 4:].any()
    assert (values[:, :4] == 255).all() and (values[:, 4:] < 245).all()
    values, saturated = pixels.digitise(exposed(1e9, (8, 8)), 1, pixels.everything)
    assert saturated.all() and (values == 255).all()
    with pytest.raises(ValueError, match="saturation would never be seen"):
        CmosSetting(well=50_000.0)


def test_patterns_have_their_spreads_and_stay() -> None:
    """PRNU at half scale, dark current's spread after 20 s, columns: standard deviation over
    pixels of values with nothing else kept, less the converter's 1/12."""
    setting = CmosSetting(prnu=0.05, dsnu=0.2, column=0.01, dark_rate=624.0)
    pixels = AdaptivePixels((200, 200), setting)
    count = 200 * 200
    half = exposed(0.5, pixels.shape)
    values = pixels.convert(half, 1, frozenset({"PRNU"})).astype(float)
    assert values.std() ** 2 - 1 / 12 == pytest.approx(
        (0.05 * 128) ** 2, rel=Z * math.sqrt(2 / count)
    )
    assert (pixels.convert(half, 2, frozenset({"PRNU"})) == values).all()
    dark = exposed(0.0, pixels.shape, 20.0)
    values = pixels.convert(dark, 1, frozenset({"dark current", "DSNU"})).astype(float)
    mean = setting.dark_now * 20.0 / setting.step
    assert values.mean() + 0.5 == pytest.approx(mean, rel=Z * 0.2 / math.sqrt(count) + 1e-4)
    assert values.var() - 1 / 12 == pytest.approx((0.2 * mean) ** 2, rel=Z * math.sqrt(2 / count))
    values = pixels.convert(half, 1, frozenset({"column pattern"})).astype(float)
    assert (values == values[0]).all()
    assert values[0].var() - 1 / 12 == pytest.approx(2.56**2, rel=Z * math.sqrt(2 / 200))


def test_bands_of_a_frame_are_the_frame() -> None:
    pixels = AdaptivePixels((12, 9))
    light = np.linspace(0, 1, 108).reshape(12, 9)
    whole = exposed(light, (12, 9), 0.02, 5)
    made = pixels.convert(whole, 9, pixels.everything)
    for first, last in ((0, 5), (5, 12)):
        part = Exposed(
            light[first:last], np.full(last - first, 0.02), np.zeros(last - first), first, 5
        )
        assert (pixels.convert(part, 9, pixels.everything) == made[first:last]).all()
    other = pixels.convert(exposed(light, (12, 9), 0.02, 6), 9, pixels.everything)
    assert (other != made).any()


@pytest.mark.parametrize("seconds", [1e-6, 65.536e-3])
def test_leaving_an_effect_out_moves_no_value_more_than_its_bound(seconds: float) -> None:
    """Light over one DN and a half around two levels, 12 frames of the same draws. The mean's
    shift is squared through two halves of the frames and the noise's through two of the rows: what
    chance adds to them is then no part of it."""
    pixels = AdaptivePixels((48, 64))
    s = pixels.setting
    for level in (3.0, 100.0):
        ramp = np.linspace(level, level + 1, 64, endpoint=False) * s.step / s.sensitivity
        scene = pixels.summary((float(ramp[0]), float(ramp[-1])), (seconds, seconds), 12)
        rows = [exposed(ramp, pixels.shape, seconds, n) for n in range(12)]
        every = np.stack([pixels.convert(r, 5, pixels.everything) for r in rows]).astype(float)
        for name, effect in pixels.effects.items():
            left = pixels.everything - {name}
            less = np.stack([pixels.convert(r, 5, left) for r in rows]).astype(float)
            shift = every - less
            halves = shift[:6].mean(0) * shift[6:].mean(0)
            moved = max(float(halves.mean()), 0.0) / max(level, 1.0) ** 2
            noise, quiet = (np.sqrt(v.var(0, ddof=1).reshape(2, 24, 64).mean(1))
                            for v in (every, less))  # fmt: skip
            louder = np.prod((noise - quiet) / np.maximum(noise, 1 / math.sqrt(12)), axis=0)
            bound = effect.bound(scene)
            assert bound.kind == "estimate"
            error = Z / math.sqrt(halves.size) * float(halves.std()) / max(level, 1.0) ** 2
            assert moved <= (2 * bound.value) ** 2 + error, name
            error = Z / 8 * float(louder.std())
            assert louder.mean() <= (2 * bound.value) ** 2 + error, name


def test_bounds_are_small_where_an_effect_hardly_is() -> None:
    pixels = AdaptivePixels()
    bright = pixels.summary((50e-3, 0.8), (1e-6, 1e-5), 10)
    bounds = {name: effect.bound(bright).value for name, effect in pixels.effects.items()}
    for name in ("dark current", "dark shot noise", "DSNU"):
        assert bounds[name] < 1e-3
    assert bounds["shot noise"] > 0.3 and bounds["reset noise"] > 0.02
    tiles = replace(bright, darkest=np.array([100.0, 4e4]), brightest=np.array([200.0, 5e4]))
    shaped = pixels.effects["read noise"].bound(tiles).value
    assert shaped.shape == (2,) and shaped[0] > shaped[1] > 0
    for effect in pixels.effects.values():
        assert effect.cost(bright) > 0 and effect.scope == "plane"


def test_settings_that_cannot_be_are_refused() -> None:
    for name, value in (
        ("gain", 0.0),
        ("read_noise", -1.0),
        ("full_scale", math.inf),
        ("prnu", math.nan),
    ):
        with pytest.raises(ValueError, match="must be"):
            replace(CmosSetting(), **{name: value})
