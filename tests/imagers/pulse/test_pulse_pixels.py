"""Pulse-width and pulse-frequency pixels against the laws of document 000, section 2."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cosim import InputError
from imagers.common.model import measure_frame
from imagers.common.scenery import Still
from imagers.pulse.model import PulseModel
from imagers.pulse.section import PfmSection, PwmSection
from sensor.frame_pixels import Exposed

EVERY = frozenset({"shot noise", "reset noise", "dark current"})


def model(kind: str, **keys: Any) -> PulseModel:
    section = {"pwm": PwmSection, "pfm": PfmSection}[kind]
    made = section.model_validate({"kind": kind, "rows": 64, "columns": 64})
    return PulseModel(made.model_copy(update=keys))


def values(made: PulseModel, lux: float, kept: frozenset[str] = EVERY, n: int = 1) -> Any:
    """(n, 64, 64) values of a uniform, steady light."""
    scene, stop = Still(np.full(made.shape, lux)), made.timing.ready(n - 1)
    return np.stack([f.values for f in made.make().film(scene, stop, seed=5, kept=kept)])


def lux_of(made: PulseModel, electrons: float) -> float:
    """Light that gives so many photoelectrons in an exposure."""
    return electrons / made.pixels.responsivity / made.section.exposure


def test_a_width_is_threshold_over_current() -> None:
    """Document 000: T = C V / I. Without noise the value is the tick in which T ends."""
    made = model("pwm", dark_current=0.0)
    for electrons in (62_401.0, 1e5, 1e6, 1e8):
        seconds = max(62_400 / electrons * made.section.exposure, made.section.shortest)
        tick = made.section.exposure / (2**16 - 2)
        got = values(made, lux_of(made, electrons), frozenset())
        assert np.all(np.abs(got - math.ceil(seconds / tick)) <= 1)
        back = made.pixels.lux(got[0, 0, 0])
        if electrons < 1e6:
            assert back == pytest.approx(lux_of(made, electrons), rel=1e-3)
    # A threshold that is not reached: the largest value, read as no light.
    dark = values(made, lux_of(made, 62_000.0), frozenset())
    assert np.all(dark == 2**16 - 1) and np.all(made.pixels.lux(dark) == 0)


def test_a_count_is_the_whole_thresholds_of_the_charge() -> None:
    """Document 000: f = I / (C V). Counts stop at the circuit's fastest rate."""
    made = model("pfm", dark_current=0.0)
    for electrons in (0.0, 999.0, 1000.5, 12_345.0):
        got = values(made, lux_of(made, electrons), frozenset())
        assert np.all(got == math.floor(electrons / 1000))
    assert made.pixels.most == 20_000  # 20 ms of 1 us
    assert np.all(values(made, lux_of(made, 1e9), frozenset()) == 20_000)


@pytest.mark.parametrize("kind", ["pwm", "pfm"])
@pytest.mark.parametrize("electrons", [80_000.0, 400_000.0])
def test_mean_and_variance_are_the_closed_form_s(kind: str, electrons: float) -> None:
    """16 frames of 4096 pixels, with a reset noise that counts as much as the shot noise."""
    threshold = 62_400.0 if kind == "pwm" else 300.0
    made = model(kind, threshold=threshold, reset_noise=math.sqrt(threshold))
    got = values(made, lux_of(made, electrons), n=16).astype(float)
    mean, variance = made.pixels.mean_variance(
        lux_of(made, electrons) * made.section.exposure, made.section.exposure
    )
    n = got.size
    # The mean of 1/current is above that of the mean current by its relative variance.
    bias = 2 * variance / mean if kind == "pwm" else 0.0
    assert got.mean() == pytest.approx(mean, abs=5 * math.sqrt(variance / n) + bias)
    # Of a quotient the variance has a term of the fourth order.
    fourth = 10 * variance / mean**2 if kind == "pwm" else 0.0
    assert got.var() == pytest.approx(variance, rel=6 * math.sqrt(2 / n) + fourth)
    light = made.pixels.lux(got).mean()
    assert light == pytest.approx(lux_of(made, electrons), rel=2e-3)


def test_the_deviation_of_a_width_is_root_two_over_threshold() -> None:
    """Shot noise alone: sigma_T / T = 1 / sqrt(Q); equal reset noise makes it sqrt(2 / Q)."""
    made = model("pwm", threshold=10_000.0, reset_noise=100.0, dark_current=0.0)
    light = lux_of(made, 20_000.0)
    for kept, factor in ((EVERY - {"reset noise"}, 1.0), (EVERY, 2.0)):
        got = values(made, light, kept, n=8).astype(float)
        assert (got.std() / got.mean()) ** 2 == pytest.approx(factor / 10_000, rel=0.05)


def test_a_range_is_of_time_or_of_counts() -> None:
    """PWM: longest over shortest width; PFM: most pulses over one."""
    pwm, pfm = model("pwm", dark_current=0.0), model("pfm", dark_current=0.0, bits=10)
    least, most = pwm.pixels.light_range(pwm.section.exposure)
    assert most / least == pytest.approx(20e-3 / 1e-6)
    least, most = pfm.pixels.light_range(pfm.section.exposure)
    assert most / least == pytest.approx(1023)
    # A dark current that fills the well in 10 s shortens nothing; one that takes 5 ms does.
    leaky = model("pwm", dark_current=62_400 / 5e-3)
    least, most = leaky.pixels.light_range(leaky.section.exposure)
    assert most / least == pytest.approx(5e-3 / 1e-6)


def test_light_of_a_course_ends_a_width_where_its_charge_reaches_the_threshold() -> None:
    """Light that comes in the second half: a width of half the exposure and Q over the current."""
    made = model("pwm", dark_current=0.0)
    course = np.concatenate([np.zeros(16), np.linspace(1, 16, 16) / 16])
    charge = 4 * 62_400 * course / made.pixels.responsivity
    exposed = Exposed(
        np.broadcast_to(charge, (1, 64, 32)), np.full(1, made.section.exposure), np.zeros(1), 0, 0
    )
    got = made.pixels.convert(exposed, 1, frozenset())
    assert np.all(np.abs(got - (0.5 + 0.5 / 4) * (2**16 - 2)) <= 1)


@pytest.mark.parametrize("kind", ["pwm", "pfm"])
def test_a_bound_holds_what_leaving_an_effect_out_does(kind: str) -> None:
    made = model(kind, threshold=2000.0, reset_noise=60.0, dark_current=2e5)
    electrons = 30_000.0
    light = lux_of(made, electrons)
    seconds = made.section.exposure
    summary = made.pixels.summary((light * seconds, light * seconds), (seconds, seconds), 8)
    full = values(made, light, n=8).astype(float)
    for name, effect in made.pixels.effects.items():
        less = values(made, light, EVERY - {name}, n=8).astype(float)
        change = abs(1 - less.std() / full.std())
        if name == "dark current":
            change = abs(1 - less.mean() / full.mean())
        assert change <= effect.bound(summary).value * 1.05 + 0.01, name


def test_a_shortest_width_beyond_the_exposure_is_refused() -> None:
    with pytest.raises(InputError, match=r"imager\.shortest must be at most the exposure, 20 ms"):
        PwmSection.model_validate({"kind": "pwm", "shortest": "30 ms"})


@pytest.mark.parametrize("kind", ["pwm", "pfm"])
def test_a_run_whose_light_reaches_no_threshold_says_so(kind: str) -> None:
    made = model(kind, threshold=60_000.0, dark_current=0.0)
    for electrons, said in ((1000.0, 1), (200_000.0, 0)):
        imager = made.make()
        still = Still(np.full(made.shape, lux_of(made, electrons)))
        film = imager.film(still, made.timing.ready(1), seed=1, kept=EVERY)
        notes = made.notes([measure_frame(frame) for frame in film])
        assert len(notes) == said and all("lower imager.threshold" in note for note in notes)
    assert made.notes([]) == []
