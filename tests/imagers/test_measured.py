"""The laboratory measures the imagers of the documents and finds what they are set to.

Each is measured on a small chip. Where the standard's model does not hold it is said what it
measures then: an EMCCD's gain with its excess noise, an EBAPS likewise.
"""

from __future__ import annotations

import math

import pytest
from scipy.stats import norm

from cosim.light.radiometry import photons_per_lux
from imagers.adaptive.pixels import AdaptivePixels
from imagers.catalogue import measured_cameras
from imagers.ebaps.pixels import EbapsPixels
from imagers.emccd.pixels import EmccdPixels, excess_noise_squared
from imagers.emccd.pixels.chip import dark_current
from sensor.laboratory.bench import Bench
from sensor.laboratory.emva import Report, measure_camera

FAR = float(norm.isf(0.5e-6) / norm.isf(0.005))
PITCH = 16e-6
"""Metres, of the EMCCD."""


def check(report: Report, truth: dict[str, float]) -> None:
    """Every figure within its 99 % limits but for one, that within limits of one in a million."""
    missed = [name for name, value in truth.items() if not report[name].holds(value)]
    assert len(missed) <= 1, [(n, truth[n], report[n]) for n in missed]
    for name, value in truth.items():
        found = report[name]
        side = found.high - found.value if value > found.value else found.value - found.low
        assert abs(value - found.value) < FAR * side, name


def test_the_adaptive_exposure_sensor() -> None:
    """8 bits that truncate and no black level: a bias light gives darkness its place."""
    pixels, seconds, area = AdaptivePixels((32, 96)), 0.01, 1e-10
    s = pixels.setting
    bench = Bench(pixels, area, seconds, (0.01, 2, 4), rows=32, frames=6, stack=32, bias=None)
    report = measure_camera(bench)
    assert report.transfer.dark.photons > 0 and "bias" in report.notes[0]
    dark = s.dark_now * seconds
    efficiency = s.sensitivity / (area * photons_per_lux(555))
    check(report, {
        "gain": 1 / s.step, "responsivity": efficiency / s.step, "quantum_efficiency": efficiency,
        "dark_noise": math.sqrt(dark + s.reset_noise**2 + s.read_noise**2),
        "dark_current": s.dark_now, "dark_current_variance": s.dark_now,
        "dsnu": math.hypot(s.dsnu * dark, s.column * 256 * s.step), "prnu": 100 * s.prnu,
        "linearity_error": 0,
    })  # fmt: skip


@pytest.mark.parametrize("gain", [1.0, 100.0])
def test_the_emccd(gain: float) -> None:
    """At gain 1 the figures are the chip's. At a high gain photon transfer takes the excess noise
    F^2 for gain: K F^2, and efficiency and dark current 1/F^2 of what they are."""
    pixels = EmccdPixels(gain=gain, shape=(48, 88))
    seconds, dark = 0.01, dark_current(pixels.kelvin, pixels.dark)
    bench = Bench(
        pixels, PITCH**2, seconds, (0.01, 2, 4), rows=32, first=8, columns=(12, 64), levels=10,
        frames=6, stack=24, kept=frozenset(pixels.effects) - {"smear"},
    )  # fmt: skip
    report = measure_camera(bench)
    excess = excess_noise_squared(gain, pixels.stages)
    assert excess == 1 if gain == 1 else 1.9 < excess < 2
    system = gain / pixels.step * excess
    noise = math.sqrt(
        (dark * seconds + pixels.clock_induced) * excess * gain**2 + pixels.read_noise**2
    )
    check(report, {
        "gain": system, "responsivity": pixels.quantum_efficiency * gain / pixels.step,
        "quantum_efficiency": pixels.quantum_efficiency / excess,
        "dark_noise": noise / pixels.step / system, "dark_current": dark / excess,
        "prnu": 100 * pixels.prnu,
    })  # fmt: skip
    assert gain == 1 or not report["gain"].holds(gain / pixels.step)


def test_the_ebaps() -> None:
    """At -1500 V some ten photoelectrons fill the scale, so slopes are fitted low down. Of the
    light, what is measured is what lands and multiplies: QE (1 - loss)/F^2."""
    pixels, seconds = EbapsPixels(shape=(32, 96)), 1e-3
    tube, silicon = pixels.tube, pixels.silicon
    left_out = {"ion events", "direct light", "photocathode emission"}
    bench = Bench(
        pixels, silicon.area, seconds, (0.001, 0.1, 0.2), rows=32, levels=8, frames=8, stack=32,
        kept=frozenset(pixels.effects) - left_out, linear=0.15,
    )  # fmt: skip
    report = measure_camera(bench)
    gain = tube.gain(pixels.volts)
    excess = 1 + tube.gain_variance / gain
    lands = tube.electrons_per_lux / photons_per_lux(555) * (1 - tube.loss)
    dark = silicon.dark_rate(pixels.kelvin)
    system = silicon.dn_per_electron * gain * excess
    noise = silicon.dn_per_electron * math.hypot(silicon.read_noise, math.sqrt(dark * seconds))
    check(report, {
        "gain": system, "responsivity": lands * gain * silicon.dn_per_electron,
        "quantum_efficiency": lands / excess, "dark_noise": noise / system,
        "dark_current": dark * silicon.dn_per_electron / system,
    })  # fmt: skip


def test_the_ebaps_without_high_voltage() -> None:
    """The bare silicon behind the photocathode, measured by its closed form."""
    pixels, seconds = EbapsPixels(shape=(32, 96), volts=0.0), 0.016
    silicon = pixels.silicon
    report = measure_camera(
        Bench(pixels, silicon.area, seconds, (0.001, 0.2, 0.4), rows=32, levels=8, frames=8)
    )
    (dark, noise), (light, more) = (pixels.mean_variance(x, seconds) for x in (0, 1e-3))
    gain = (more - noise) / (light - dark)
    response = (light - dark) / (1e-3 * silicon.area * photons_per_lux(555))
    check(report, {
        "gain": gain, "responsivity": response, "quantum_efficiency": response / gain,
        "dark_noise": math.sqrt(noise - 1 / 12) / gain,
        "dark_current": silicon.dark_rate(pixels.kelvin),
    })  # fmt: skip


def test_every_measured_imager_has_a_bench() -> None:
    cameras = measured_cameras()
    assert list(cameras) == ["adaptive-exposure", "ebaps", "emccd"]
    for camera in cameras.values():
        assert camera.bench(3).seed == 3
