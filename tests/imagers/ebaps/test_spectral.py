"""Spectral response: electrons of a lux for each photocathode and illuminant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.light.radiometry import ILLUMINANTS, photon_density, photons_per_lux
from imagers.ebaps.pixels import PHOTOCATHODES, EbapsPixels, Tube, spectral_ratios
from imagers.ebaps.pixels.tube import SILICON, Response, Spectral
from sensor.frame_pixels import Exposed


@pytest.mark.parametrize(("name", "electrons"), [("GaAs", 1.19e16), ("GaAsP", 4.5e15)])
def test_electrons_of_a_lux_from_a_lamp(name: str, electrons: float) -> None:
    cathode = PHOTOCATHODES[name]
    assert cathode.electrons_per_lux("lamp") == pytest.approx(electrons, rel=3e-3)
    assert 0.2 < cathode.plateau < 0.5  # what such photocathodes reach: a check on the shape


def test_the_plateau_of_silicon_is_possible() -> None:
    assert SILICON.electrons_per_lux("lamp") == pytest.approx(3.3e16, rel=1e-3)
    assert 0.5 < SILICON.plateau < 1


def test_the_band_is_the_printed_one() -> None:
    nm = np.arange(250.0, 1100.0)
    there = nm[PHOTOCATHODES["GaAs"].efficiency(nm) > 0]
    assert (there[0], there[-1]) == (301, 969)  # 0.3 to 0.97 um, at whose ends it is 0


def test_one_wavelength() -> None:
    cathode = PHOTOCATHODES["GaAs"]
    assert cathode.electrons_per_lux("monochromatic", 600) == pytest.approx(
        cathode.plateau * photons_per_lux(600), rel=1e-12
    )
    assert cathode.electrons_per_lux("monochromatic", 425) == pytest.approx(
        cathode.plateau / 2 * photons_per_lux(425), rel=1e-12
    )


def test_a_narrow_band_counts_the_photons_of_one_wavelength() -> None:
    """Under another illuminant a narrow band gives what the photons at its wavelength are."""
    narrow = Response(550, 555, 555, 560, 100.0)
    lamp, day = (narrow.electrons_per_lux(name) for name in ("lamp", "daylight"))
    assert lamp == pytest.approx(100e-6 / 1.602176634e-19, rel=1e-12)
    there = [float(photon_density(ILLUMINANTS[n], np.array(555.0))) for n in ("lamp", "daylight")]
    assert day / lamp == pytest.approx(there[1] / there[0], rel=1e-3)


def test_the_lamp_changes_nothing() -> None:
    assert spectral_ratios("GaAs", "lamp") == Spectral(1.0, 1.0)
    with pytest.raises(ValueError, match="within 300 to 730 nm for GaAsP, not 740 nm"):
        spectral_ratios("GaAsP", "monochromatic", 740)


@pytest.mark.parametrize("volts", [0.0, 1500.0])
def test_pixels_see_the_ratio(volts: float) -> None:
    """The mean of a frame above black scales with the electrons of a lux: of the photocathode with
    high voltage, of the silicon without. Dark emission does not scale."""
    ratios = spectral_ratios("GaAs", "night-sky")
    lamp = EbapsPixels((48, 48), volts=volts, tube=Tube(emission_lux=0.0))
    if not volts:
        lamp = replace(lamp, silicon=replace(lamp.silicon, leakage=1.0))
    sky = replace(lamp, spectral=ratios)
    lux_seconds = 5e-6 if volts else 5e-5  # neither clipped nor rounded to few DN
    kept = frozenset({"direct light"})
    light = Exposed(np.full((48, 48), lux_seconds), np.full(48, 0.01), np.zeros(48), 0, 0)
    means = [p.convert(light, 1, kept).mean() - p.silicon.black for p in (lamp, sky)]
    wanted = ratios.photocathode if volts else ratios.silicon
    assert means[1] / means[0] == pytest.approx(wanted, rel=1e-3)
    predicted = [p.mean_variance(lux_seconds, 0.0)[0] - p.silicon.black for p in (lamp, sky)]
    assert predicted[1] / predicted[0] == pytest.approx(wanted, rel=2e-2)


def test_emission_of_the_photocathode_keeps_its_rate() -> None:
    lamp = EbapsPixels((8, 8))
    sky = replace(lamp, spectral=spectral_ratios("GaAs", "daylight"))
    assert sky.budget(0.0, 1.0).photoelectrons == lamp.budget(0.0, 1.0).photoelectrons > 0
