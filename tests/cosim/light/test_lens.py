"""The lens: illuminance and blur against closed forms."""

from __future__ import annotations

from math import inf, nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Lens, Light, Piece
from cosim.light.lens import diffraction_mtf

EPS = float(np.finfo(np.float32).eps)
PITCH_UM = 10.0


def test_gain_is_the_camera_equation() -> None:
    # 0.9 / (4 * 2.8^2 * 1.1^2) = 0.9 / 37.9456
    assert Lens(2.8, 0.9, 0.1).gain == pytest.approx(0.0237182, rel=1e-5)
    # A lossless lens at f/1 passes a quarter; at the limit of f/0.5 the scene's own exitance.
    assert Lens(1.0, 1.0).gain == 0.25
    assert Lens(0.5, 1.0).gain == 1.0
    # Two stops down, a quarter; at 1:1 the light of twice the f-number.
    assert Lens(4.0).gain / Lens(2.0).gain == 0.25
    assert Lens(2.0, magnification=1.0).gain == Lens(4.0).gain


def test_mtf_is_the_closed_form() -> None:
    cutoff = 900e3
    v = np.array([0.0, 0.5, 1.0, 1.5])
    # v = 1/2: 2/pi (pi/3 - sqrt(3)/4)
    expected = [1.0, 2 / pi * (pi / 3 - 3**0.5 / 4), 0.0, 0.0]
    np.testing.assert_allclose(diffraction_mtf(v * cutoff, cutoff), expected, atol=1e-15)
    assert expected[1] == pytest.approx(0.391, abs=5e-4)


def test_mtf_falls_at_first_as_the_perimeter_of_the_pupil() -> None:
    # Near 0 the overlap of two discs shrinks by 4/pi v.
    assert (1 - diffraction_mtf(np.array(1e-4), 1.0)) / 1e-4 == pytest.approx(4 / pi, rel=1e-6)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("mode", [1, 4, 13, 29])
@pytest.mark.parametrize("lens", [Lens(2.8, psf="airy"), Lens(8.0, psf="airy", magnification=0.5)])
def test_a_sinusoid_falls_by_exactly_the_mtf(lens: Lens, mode: int, axis: int) -> None:
    n, m = 30, 22
    wave = np.cos(pi * mode * (np.arange(n) + 0.5) / n)
    plane = np.broadcast_to((1 + 0.8 * wave)[:, None], (n, m)).astype(np.float32)
    frequency = np.array(mode / (2 * n * PITCH_UM * 1e-6))
    cutoff = 1 / (555e-9 * lens.f_number * (1 + lens.magnification))
    left = 0.8 * diffraction_mtf(frequency, cutoff)
    assert 0.1 < left < 0.799
    expected = np.broadcast_to((1 + left * wave)[:, None], (n, m))
    image = lens.blur(plane if axis == 0 else plane.T.copy(), PITCH_UM)
    np.testing.assert_allclose(image if axis == 0 else image.T, expected, rtol=0, atol=4 * EPS)


@given(
    seed=st.integers(0, 2**32 - 1),
    f_number=st.floats(0.5, 64),
    pitch=st.floats(1, 30),
    shape=st.tuples(st.integers(1, 20), st.integers(1, 20)),
    sparse=st.booleans(),
)
def test_blur_keeps_the_sum_of_light_and_never_goes_below_zero(
    seed: int, f_number: float, pitch: float, shape: tuple[int, int], sparse: bool
) -> None:
    rng = np.random.default_rng(seed)
    plane = (rng.random(shape) * 1e4 * (rng.random(shape) < (0.1 if sparse else 1))).astype(
        np.float32
    )
    image = Lens(f_number, psf="airy").blur(plane, pitch)
    assert image.dtype == np.float32
    assert (image >= 0).all()
    assert image.sum(dtype=float) == pytest.approx(plane.sum(dtype=float), rel=4 * EPS, abs=0)


def test_a_point_keeps_its_light_though_it_rings() -> None:
    plane = np.zeros((33, 33), np.float32)
    plane[16, 16] = 1e6
    image = Lens(8.0, psf="airy").blur(plane, PITCH_UM)
    assert image.sum(dtype=float) == pytest.approx(1e6, rel=4 * EPS)
    assert 0 < np.delete(image.ravel(), 16 * 33 + 16).max() < image[16, 16]
    assert not Lens(8.0, psf="airy").blur(np.zeros((4, 4), np.float32), PITCH_UM).any()


def test_light_near_an_edge_does_not_come_out_at_the_other() -> None:
    plane = np.zeros((8, 200), np.float32)
    plane[:, 0] = 1000
    image = Lens(22.0, psf="airy").blur(plane, PITCH_UM)
    assert image[:, -1].max() < 1e-3 * image[:, 1].min()


def test_without_a_psf_the_very_plane_comes_back() -> None:
    plane = np.ones((4, 4), np.float32)
    assert Lens(2.8).blur(plane, PITCH_UM) is plane


@pytest.mark.parametrize(
    ("psf", "box"), [("none", (1, 3, 1, 4)), ("airy", None)], ids=["none", "airy"]
)
def test_the_relay_maps_levels_and_says_what_changes(psf, box) -> None:
    lens = Lens(2.0, 0.8, psf=psf)
    first = np.random.default_rng(1).random((5, 6)).astype(np.float32)
    last = first.copy()
    last[1:3, 1:4] = 1
    (image,) = lens.relay(PITCH_UM)(Light((Piece(0, 10, first, last, (1, 3, 1, 4)),))).pieces
    np.testing.assert_allclose(image.last, 0.05 * lens.blur(last, PITCH_UM), rtol=2 * EPS)
    assert image.changed == box
    assert (image.start, image.stop) == (0, 10)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"f_number": 0.49}, "f-number must be at least 0.5, not 0.49"),
        ({"f_number": -2.0}, "f-number must be at least 0.5, not -2"),
        ({"f_number": nan}, "f-number must be at least 0.5, not nan"),
        ({"f_number": inf}, "a lens must be described by finite numbers, not"),
        ({"transmission": 0.0}, "transmission must be in (0, 1], not 0"),
        ({"transmission": 1.01}, "transmission must be in (0, 1], not 1.01"),
        ({"transmission": nan}, "transmission must be in (0, 1], not nan"),
        ({"magnification": -0.1}, "magnification must be >= 0, not -0.1"),
        ({"magnification": nan}, "magnification must be >= 0, not nan"),
        ({"wavelength_nm": 0.0}, "wavelength must be above 0 nm, not 0 nm"),
        ({"wavelength_nm": inf}, "a lens must be described by finite numbers, not"),
    ],
)
def test_a_lens_that_cannot_be_is_refused(values: dict[str, float], text: str) -> None:
    with pytest.raises(ValueError, match="must be") as refused:
        Lens(**({"f_number": 2.8} | values))
    assert str(refused.value).startswith(text)
