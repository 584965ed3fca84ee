"""The plates against closed forms: projection, depth, masks, boxes, flow, occlusion."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from scenarios.scenes.objects.painting import HIDDEN, SEEN
from scenarios.scenes.objects.plate import CATEGORIES, FOCAL, Plate, Wave
from scenarios.scenes.objects.scene import Objects, Surfaces, flow, surfaces

SHAPE = (250, 400)
PLAIN = Plate(
    category=0, a=0.3, b=0.2, power=2.0, petals=0, petal=0.0, x=0.0, y=0.0, z=3.0, swing=0.0,
    heading=0.0, rate=0.0, phase=0.0, pump=0.0, pump_phase=0.0, turn=0.0, spin=0.0, tilt=0.0,
    tilt_axis=0.0, tone=0.5, waves=(Wave(2.0, 1.0, 0.3, 0.4),),
)  # fmt: skip
WALL = replace(PLAIN, category=None, z=12.0, waves=(Wave(0.7, 0.4, 1.0, 0.3),))


def showing(*plates: Plate, shape: tuple[int, int] = SHAPE) -> Objects:
    scene = Objects(shape)
    vars(scene)["plates"] = (WALL, *plates)
    return scene


def rodrigues(angle: float, axis: tuple[float, float, float]) -> np.ndarray:
    return cv2.Rodrigues(angle * np.array(axis))[0]


def test_a_point_is_seen_where_the_rays_of_a_pinhole_camera_meet_the_picture() -> None:
    plate = replace(
        PLAIN, x=0.4, y=-0.2, swing=0.1, heading=0.7, rate=30.0, phase=0.2, pump=0.05,
        pump_phase=1.0, turn=0.3, spin=20.0, tilt=0.5, tilt_axis=1.1,
    )  # fmt: skip
    for t in (0.0, 0.013, 2.0):
        turn = rodrigues(0.5, (math.cos(1.1), math.sin(1.1), 0)) @ rodrigues(
            0.3 + 20 * t, (0, 0, 1)
        )
        along, deep = 0.1 * math.sin(30 * t + 0.2), 0.05 * math.sin(30 * t + 1)
        centre = (0.4 + along * math.cos(0.7), -0.2 + along * math.sin(0.7), 3 + deep)
        for u, v in ((0.0, 0.0), (0.3, -0.1), (-0.2, 0.2)):
            p = turn @ (u, v, 0) + centre
            seen = plate.homography(t, SHAPE) @ (u, v, 1)
            expected = 200 + FOCAL * 250 * p[0] / p[2], 125 + FOCAL * 250 * p[1] / p[2]
            np.testing.assert_allclose(seen[:2] / seen[2], expected, rtol=1e-12)
            np.testing.assert_allclose(seen[2], p[2], rtol=1e-12)


@pytest.mark.parametrize("category", CATEGORIES)
def test_the_mask_has_the_area_and_the_box_of_its_outline(category: str) -> None:
    plate = replace(
        PLAIN, category=CATEGORIES.index(category), a=0.5, b=0.4, turn=0.0,
        power=6.0 if category == "rectangle" else 2.0,
        petals=5 if category == "flower" else 0, petal=0.2 if category == "flower" else 0.0,
    )  # fmt: skip
    seen = surfaces(showing(plate), 0.0)
    scale = FOCAL * 250 / 3.0  # pixels a metre
    x, y, width, height, area = seen.boxes(1)[0]
    # The number of lattice points in a smooth, convex region differs from its area by the order of
    # the perimeter's root; a sixth of the perimeter is far outside that.
    perimeter = 2 * math.pi * 0.45 * scale
    assert abs(area - plate.area * scale**2) < perimeter / 6
    if category != "flower":
        assert abs(width - 2 * 0.5 * scale) <= 1 and abs(height - 2 * 0.4 * scale) <= 1
        assert abs(x + width / 2 - 200) <= 0.5 and abs(y + height / 2 - 125) <= 0.5


def test_a_turned_ellipse_has_the_box_of_its_closed_form() -> None:
    turn, scale = 0.6, FOCAL * 250 / 3.0
    x, y, width, height, _ = surfaces(showing(replace(PLAIN, turn=turn, x=0.2)), 0.0).boxes(1)[0]
    wide = math.hypot(0.3 * math.cos(turn), 0.2 * math.sin(turn)) * scale
    high = math.hypot(0.3 * math.sin(turn), 0.2 * math.cos(turn)) * scale
    assert abs(x - (200 + 0.2 * scale - wide)) <= 1 and abs(width - 2 * wide) <= 1
    assert abs(y - (125 - high)) <= 1 and abs(height - 2 * high) <= 1


def test_depth_is_that_of_the_slanted_plane() -> None:
    seen = surfaces(showing(replace(PLAIN, tilt=0.4, tilt_axis=math.pi / 2)), 0.0)
    rows, columns = np.nonzero(seen.labels == 1)
    # A plane through (0, 0, 3) turned about Y: Z = 3 - X tan(tilt), and X = Z (x - 200) / F.
    slope = (columns + 0.5 - 200) / (FOCAL * 250)
    expected = 3 / (1 + slope * math.tan(0.4))
    assert rows.size > 1000 and np.ptp(expected) > 0.2
    np.testing.assert_allclose(seen.depth[rows, columns], expected, rtol=1e-6)
    assert (seen.depth[seen.labels == 0] == 12).all()


@pytest.mark.parametrize("category", [0, 1, 2])
def test_the_light_of_a_plate_covers_its_area(category: int) -> None:
    plate = replace(
        PLAIN, category=category, a=0.5, b=0.4, power=6.0 if category == 1 else 2.0, tone=1.0,
        petals=5 if category == 2 else 0, petal=0.2 if category == 2 else 0.0, waves=(),
    )  # fmt: skip
    scene = showing(plate)
    vars(scene)["plates"] = (replace(WALL, tone=0.0, waves=()), plate)
    scale = FOCAL * 250 / 3.0
    # First-order distances and the ramp of a pixel: a few thousandths.
    np.testing.assert_allclose(scene.reflectance(0).sum(), plate.area * scale**2, rtol=3e-3)


def test_the_texture_is_the_mean_over_pixels() -> None:
    scene = showing(shape=(20, 30))
    wall = replace(WALL, waves=(Wave(1.1, 0.6, 0.4, 0.5),))
    vars(scene)["plates"] = (wall,)
    n = 64
    y, x = (np.mgrid[0 : 20 * n, 0 : 30 * n] + 0.5) / n
    u, v = (x - 15) / 24 * 12, (y - 10) / 24 * 12  # F = 24 pixels, depth 12 m
    fine = 0.5 * (1 + 0.5 * np.sin(2 * np.pi * (1.1 * u + 0.6 * v) + 0.4))
    mean = fine.reshape(20, n, 30, n).mean((1, 3))
    np.testing.assert_allclose(scene.reflectance(0), mean, atol=5e-5)
    assert np.ptp(mean) < 0.9 * np.ptp(fine)


def distance(plate: Plate, homography: np.ndarray) -> np.ndarray:
    """g / |grad g| of all pixels, with g of the plate's docstring and its gradient by differences
    of 2^-10 pixels."""

    def g(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        u, v, w = np.tensordot(np.linalg.inv(homography), np.stack([x, y, np.ones_like(x)]), 1)
        p, q = u / w / plate.a, v / w / plate.b
        norm = (abs(p) ** plate.power + abs(q) ** plate.power) ** (1 / plate.power)
        return norm / (1 + plate.petal * np.cos(plate.petals * np.arctan2(q, p))) - 1

    y, x = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]] + 0.5
    e = 2.0**-10
    slope = np.hypot(g(x + e, y) - g(x - e, y), g(x, y + e) - g(x, y - e)) / (2 * e)
    return g(x, y) / (slope + 1e-12)


@pytest.mark.parametrize("layout", [3, 8])
def test_the_loops_give_what_the_formulas_say(layout: int) -> None:
    """Loops leave out what is surely far from an edge, and have a sine of their own."""
    scene, t = Objects(SHAPE, layout, count=12, pace=20.0), 0.004
    assert {plate.category for plate in scene.plates} == {None, 0, 1, 2}
    y, x = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]] + 0.5
    light, labels, edge = np.zeros(SHAPE), np.zeros(SHAPE, int), np.zeros(SHAPE, bool)
    for n, plate in enumerate(scene.plates):
        h = plate.homography(t, SHAPE)
        d = np.full(SHAPE, -1e9) if plate.category is None else distance(plate, h)
        labels[d <= 0] = n
        edge = (edge & (d > -(2**-0.5))) | (abs(d) < 2**-0.5)
        u, v, w = np.tensordot(np.linalg.inv(h), np.stack([x, y, np.ones_like(x)]), 1)
        tone = np.ones(SHAPE)
        for wave in plate.waves:  # the mean over a pixel is within a few percent of its centre
            tone += wave.share * np.sin(2 * np.pi * (wave.p * u + wave.q * v) / w + wave.phase)
        light += np.clip(0.5 - d, 0, 1) * (plate.tone * tone - light)
    seen = surfaces(scene, t)
    assert np.count_nonzero(seen.labels != labels) <= 2
    assert np.count_nonzero(seen.edge != edge) <= 2
    assert abs(scene.reflectance(t) - light).max() < 0.02


def warped(scene: Objects, a: float, b: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The light at b brought to a by the flow, the light at a, and the occlusion."""
    moved, occlusion = flow(scene, a, b)
    y, x = np.mgrid[0 : scene.shape[0], 0 : scene.shape[1]].astype(np.float32)
    brought = cv2.remap(
        scene.reflectance(b), x + moved[..., 0], y + moved[..., 1], cv2.INTER_LINEAR
    )
    return brought, scene.reflectance(a), occlusion


@pytest.mark.parametrize("layout", range(6))
def test_light_of_two_instants_comes_together_by_the_flow(layout: int) -> None:
    scene = Objects(SHAPE, layout)
    for a, b in ((0.0, 0.0064), (0.0064, 0.0), (0.003, 0.0094)):
        brought, light, occlusion = warped(scene, a, b)
        free = occlusion == SEEN
        assert free.mean() > 0.8
        psnr = -10 * np.log10(np.mean((brought - light)[free] ** 2))
        still = -10 * np.log10(np.mean((scene.reflectance(b) - light)[free] ** 2))
        assert psnr > 45 and still < 35


def test_a_texture_has_the_sine_of_the_library() -> None:
    for phase in (*np.linspace(-8, 8, 65).tolist(), 1e4, -12345.678, 7e6):
        scene = showing(shape=(8, 8))
        vars(scene)["plates"] = (replace(WALL, waves=(Wave(0.0, 0.0, phase, 0.4),)),)
        expected = np.float32(0.5 * (1 + 0.4 * math.sin(phase)))
        np.testing.assert_allclose(scene.reflectance(0.0), expected, rtol=1e-7)


def test_occlusion_is_what_the_closed_form_covers() -> None:
    """A disc that moves to the right by d pixels covers the wall beside it."""
    plate = replace(PLAIN, a=0.3, b=0.3, swing=0.2, rate=10.0)
    b, scale = 0.012, FOCAL * 250 / 3.0
    d = 0.2 * math.sin(0.12) * scale
    moved, occlusion = flow(showing(plate), 0.0, b)
    r = 0.3 * scale
    # Wall that the disc covers at b alone: the disc less its overlap with itself moved by d.
    lens = 2 * r * r * math.acos(d / (2 * r)) - d / 2 * math.sqrt(4 * r * r - d * d)
    covered = np.count_nonzero(occlusion[:, 100:300] == HIDDEN)
    assert abs(covered - (math.pi * r * r - lens)) < 2 * math.pi * r / 6
    assert surfaces(showing(plate), 0.0).labels[125, 200] == 1
    np.testing.assert_allclose(moved[125, 200], (d, 0), atol=1e-5)
    np.testing.assert_allclose(moved[5, 5], (0, 0), atol=1e-9)
    assert occlusion[125, 200] == SEEN


@pytest.mark.slow
def test_plates_keep_their_order_and_their_speed() -> None:
    for layout in range(20):
        scene = Objects((60, 90), layout, count=12, pace=30.0)
        ends = [plate.depths() for plate in scene.plates]
        assert all(far[0] > near[1] for far, near in itertools.pairwise(ends))
        times = np.linspace(0, 0.1, 41)
        fastest = 0.0
        for a, b in itertools.pairwise(times):
            moved, occlusion = flow(scene, a, b)
            step = np.linalg.norm(moved[occlusion == SEEN], axis=-1) / (b - a)
            fastest = max(fastest, float(step.max()))
        assert 30 * 60 * 0.2 < fastest <= scene.speed()


def test_light_is_a_share_and_repeats() -> None:
    a, b = (Objects(SHAPE, 4).reflectance(0.01) for _ in range(2))
    assert np.array_equal(a, b) and a.min() >= 0 and a.max() <= 1
    assert not np.array_equal(a, Objects(SHAPE, 5).reflectance(0.01))
    still = Objects(SHAPE, pace=0.0)
    assert still.speed() == 0 and still.moving(0, 1) == (0, 0, 0, 0)
    assert isinstance(surfaces(Objects((8, 9), count=0), 0.0), Surfaces)
