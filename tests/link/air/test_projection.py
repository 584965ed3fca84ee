"""Panel pixels on camera pixels, held to direct integration and to the camera equation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cosim import InputError
from cosim.light.lens import Lens
from link.air import Aim, image_of, levels
from link.air.geometry import affine_at, lengths
from link.air.kernel import Psf
from link.air.projection import Projection, disc_kernel
from link.air.radiometry import Levels
from tests.link.air.golden import golden
from tests.link.air.scenes import AIR, OPTICS, SHAPE, Shown, make

AIRY_ZERO = 1.21967
"""First zero of the Airy pattern, wavelengths times the working f-number."""


def homography(scale: float, degrees: float, panel: tuple[int, int], camera: tuple[int, int],
               across: float = 0.0) -> np.ndarray:  # fmt: skip
    a = math.radians(degrees)
    turn = scale * np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
    out = np.eye(3)
    out[:2, :2] = turn
    out[2, 0] = across
    before, after = np.eye(3), np.eye(3)
    before[:2, 2] = -(panel[1] - 1) / 2, -(panel[0] - 1) / 2
    after[:2, 2] = (camera[1] - 1) / 2 + 0.31, (camera[0] - 1) / 2 - 0.17
    return np.asarray(after @ out @ before)


def compared(scale: float, degrees: float, psf: Psf, airy: float = 0.0, across: float = 0.0,
             shift: tuple[float, float] = (0.0, 0.0), fine: int = 10) -> np.ndarray:  # fmt: skip
    size = 24 if scale < 1 else 12
    panel, camera = (size, size + 2), (int(1.3 * scale * size) + 4,) * 2
    plane = (np.random.default_rng(7).random(panel) < 0.5).astype(np.float32)
    made = homography(scale, degrees, panel, camera, across)
    exact = golden(plane, made, camera, psf.sigma, psf.disc, airy, shift, fine)
    return np.asarray(Projection(made, panel, camera, psf)(plane, shift) - exact)


@pytest.mark.parametrize("scale", [0.3, 0.7, 1.0, 1.9, 4.0])
@pytest.mark.parametrize("degrees", [0.3, 45.0, 200.0])
def test_boxes_are_those_of_direct_integration(scale: float, degrees: float) -> None:
    error = compared(scale, degrees, Psf(), fine=24)
    assert np.sqrt((error**2).mean()) < 0.012
    assert np.abs(error).max() < 0.05


@pytest.mark.parametrize(
    ("scale", "degrees", "sigma", "disc", "airy", "across"),
    [
        (0.5, 30.0, 0.3, 0.0, 0.0, 0.0),
        (1.0, 0.3, 0.3, 0.0, 0.0, 2e-3),
        (1.0, 45.0, 0.3, 0.0, 0.0, 2.5e-3),
        (2.0, 10.0, 0.5, 0.0, 0.0, 0.0),
        (1.0, 20.0, 0.0, 1.2, 0.0, 0.0),
        (1.0, 20.0, 0.0, 0.0, 0.3, 0.0),
        (1.0, 20.0, 2.0, 0.0, 0.0, 0.0),
        (1.0, 20.0, 0.0, 3.0, 0.0, 0.0),
    ],
)
def test_blur_is_that_of_direct_integration(
    scale: float, degrees: float, sigma: float, disc: float, airy: float, across: float
) -> None:
    cutoff = AIRY_ZERO / airy if airy else None
    error = compared(scale, degrees, Psf(sigma, disc, cutoff), airy, across, fine=5)
    assert np.sqrt((error**2).mean()) < 0.012
    assert np.abs(error).max() < 0.05


@pytest.mark.parametrize(
    ("dx", "dy", "scale", "degrees"),
    [(0.4, -1.3, 1.0, 0.0), (1.7, 0.2, 0.6, 50.0), (-0.05, 0.02, 1.0, 0.3)],
)
def test_a_shift_moves_the_image(dx: float, dy: float, scale: float, degrees: float) -> None:
    error = compared(scale, degrees, Psf(), shift=(dx, dy), fine=24)
    assert np.sqrt((error**2).mean()) < 0.012
    assert np.abs(error).max() < 0.05


@pytest.mark.parametrize("psf", [Psf(), Psf(0.3, 0.0, 9.5), Psf(2.0, 4.0, 2.0)])
def test_all_light_is_kept(psf: Psf) -> None:
    """A panel well within the sensor gives it its area's light."""
    panel, camera = (20, 24), (90, 96)
    made = homography(1.3, 33.0, panel, camera)
    plane = (np.random.default_rng(3).random(panel) < 0.5).astype(np.float32)
    total = Projection(made, panel, camera, psf)(plane).sum()
    area = float(plane.sum()) * 1.3**2
    assert total == pytest.approx(area, rel=5e-3)
    # What is even stays even.
    even = Projection(made, panel, camera, psf)(np.ones(panel))
    if psf.disc == 0:
        assert even[43:47, 46:50] == pytest.approx(np.ones((4, 4)), abs=1e-5)


def test_an_even_panel_gives_the_camera_equations_lux() -> None:
    """pi L T / (4 N^2 (1 + m)^2), by `cosim.lens` as well: exitance pi L through its gain."""
    air = make(Shown(level=True))
    m = 39e-3 / (2 - 39e-3)
    exact = math.pi * 1000 * 0.9 / (4 * 1.864**2 * (1 + m) ** 2)
    assert levels(OPTICS, AIR).on == pytest.approx(exact, rel=1e-12)
    assert Lens(1.864, 0.9, m).gain * math.pi * 1000 == pytest.approx(exact, rel=1e-12)
    lit = air._lux(np.ones((32, 40), np.bool_), (0.0, 0.0), np.ones(air.patches.count))
    assert lit[24, 32] == pytest.approx(
        exact * (1 - AIR.glare) + AIR.glare * exact * _share(), 1e-3
    )


def _share() -> float:
    """Of the sensor that the panel's image covers."""
    pixel = lengths(OPTICS, 2.0).camera * 500e-6 / 2.0
    return 32 * 40 * pixel**2 / (SHAPE[0] * SHAPE[1])


def test_geometry_of_a_tilted_panel() -> None:
    """Corners go where the lens's equation puts them."""
    aim = Aim((5.0, -3.0), 30.0, (10.0, -20.0))
    made = image_of(OPTICS, aim, AIR, SHAPE)
    u, v, w = made @ np.array([19.5, 15.5, 1.0])
    assert (u / w, v / w) == pytest.approx((31.5 + 5, 23.5 - 3))
    # The right side is tilted away: smaller there than at the left.
    flat = image_of(OPTICS, Aim(tilt=(10.0, 0.0)), AIR, SHAPE)
    right, left = (affine_at(flat, x, 15.5) for x in (39.0, 0.0))
    c = lengths(OPTICS, 2.0).camera
    depth = 2 + 19.5 * 500e-6 * math.sin(math.radians(10))
    assert right[1, 1] == pytest.approx(c * 500e-6 / depth, rel=1e-9)
    assert right[1, 1] < left[1, 1]
    turned = image_of(OPTICS, Aim(rotation=90.0), AIR, SHAPE)
    step = affine_at(turned, 19.5, 15.5)[:, 0]  # a panel pixel to the right goes down
    assert step[1] > 0
    assert step[0] == pytest.approx(0, abs=1e-9)


def test_defocus_is_that_of_a_thin_lens() -> None:
    """Blur circle f^2 |d - s| / (N d (s - f)), s focused, d the panel's (e.g. Ray, 2002)."""
    made = lengths(replace(OPTICS, focus=1.0), 2.0)
    circle = 39e-3**2 * 1.0 / (1.864 * 2.0 * (1.0 - 39e-3))
    assert 2 * made.disc * 10e-6 == pytest.approx(circle, rel=1e-9)
    assert lengths(OPTICS, 2.0).disc == 0
    disc = disc_kernel(3.3)
    assert disc.sum() == pytest.approx(1)
    at = np.arange(disc.shape[0]) - disc.shape[0] // 2
    assert (disc * at**2).sum() == pytest.approx(3.3**2 / 4 + 1 / 12, rel=0.01)


@pytest.mark.parametrize(
    ("optics", "aim", "says"),
    [
        ({"focus": 0.01}, Aim(), "the focus must be beyond the focal length"),
        ({"pitch": 1.0}, Aim(tilt=(70.0, 0.0)), "the panel must be wholly before the lens"),
    ],
)
def test_what_cannot_be_seen_is_said(optics: dict[str, float], aim: Aim, says: str) -> None:
    with pytest.raises(InputError, match=says):
        image_of(replace(OPTICS, **optics), aim, AIR, SHAPE)


def test_levels_add_up() -> None:
    made = levels(OPTICS, replace(AIR, ambient=500.0))
    assert isinstance(made, Levels)
    assert made.face / made.panel == pytest.approx(0.04 * 500 / math.pi / 1000)
    assert made.around / made.face == pytest.approx(0.18 / 0.04)
    assert made.on == pytest.approx(made.panel + made.face)
