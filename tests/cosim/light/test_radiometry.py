"""From lux to photons, against published figures."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.light.radiometry import luminous_efficiency, photons_per_lux


def test_photons_in_a_lux_at_555_nm_are_those_of_the_paper() -> None:
    # Huang 2022, section 4.3, prints three digits.
    assert photons_per_lux() == pytest.approx(4.09e15, abs=0.005e15)
    # 555 nm / (683 lm/W h c), worked by hand from the SI constants.
    assert photons_per_lux(555) == pytest.approx(4.0908e15, rel=1e-4)


def test_threshold_is_reached_in_the_papers_3_5_ns() -> None:
    # Section 4.3: 1e5 lux on 100 um2 with a quantum efficiency of 0.7 fill 100 electrons.
    electrons = photons_per_lux() * 1e5 * 100e-12 * 0.7
    assert 100 / electrons == pytest.approx(3.5e-9, rel=0.02)


@pytest.mark.parametrize(
    ("nm", "v"),
    [(400, 0.0004), (450, 0.038), (507, 0.4441), (510, 0.503), (550, 0.995), (555, 1.0),
     (560, 0.995), (610, 0.503), (650, 0.107), (700, 0.0041)],
)  # fmt: skip
def test_luminous_efficiency_is_the_cie_curve(nm: float, v: float) -> None:
    assert luminous_efficiency(nm) == pytest.approx(v, rel=0.013)


@pytest.mark.parametrize(
    ("nm", "v"),
    [(445, 0.0298), (465, 0.0739), (485, 0.1693), (505, 0.4073), (515, 0.6082),
     (525, 0.7932), (535, 0.9149), (545, 0.9803), (565, 0.9786), (575, 0.9154), (585, 0.8163),
     (595, 0.6949), (605, 0.5668), (615, 0.4412), (625, 0.3210), (645, 0.1382), (665, 0.0446)],
)  # fmt: skip
def test_between_the_tables_points_it_follows_the_cie_table_in_steps_of_5_nm(
    nm: float, v: float
) -> None:
    # Interpolation adds under 1 % to the table's last digit.
    assert luminous_efficiency(nm) == pytest.approx(v, rel=0.01, abs=0.00005)


def test_the_curves_blue_end_is_interpolated_to_4_percent() -> None:
    assert luminous_efficiency(425) == pytest.approx(0.0073, rel=0.04)


def test_the_area_under_the_curve_is_the_cie_sum() -> None:
    # The CIE sum of V over 360 to 830 nm is 106.857 nm.
    area = sum(luminous_efficiency(nm) for nm in np.arange(380, 781))
    assert area == pytest.approx(106.857, abs=0.03)


def test_more_photons_are_needed_where_the_eye_is_weak() -> None:
    ratio = photons_per_lux(650) / photons_per_lux(555)
    assert ratio == pytest.approx(650 / 555 / 0.107, rel=1e-3)


@pytest.mark.parametrize("nm", [379.9, 780.1, 0, -555, float("nan"), float("inf")])
def test_a_wavelength_without_lux_is_refused(nm: float) -> None:
    with pytest.raises(ValueError, match=r"wavelength must be 380 to 780 nm, not .* nm"):
        photons_per_lux(nm)
