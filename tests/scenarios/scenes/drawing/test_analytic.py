"""Analytic scenes: their pictures against their own closed forms, and their promises."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from scenarios.scenes.charts import star as star_module
from scenarios.scenes.charts.star import RADIUS, Star
from scenarios.scenes.drawing.bodies import capsules
from scenarios.scenes.drawing.canvas import Canvas, Item, Layer, View, body
from scenarios.scenes.drawing.shading import Surface, noise, square_mean
from scenarios.scenes.people import wave as wave_module
from scenarios.scenes.people.wave import Wave

SHAPE = (220, 260)
SCENES = [Wave(SHAPE), Star(SHAPE), Star(SHAPE, profile="sine")]
CANVASES = {Wave: wave_module._canvas, Star: star_module._canvas}
each_scene = pytest.mark.parametrize("scene", SCENES, ids=lambda s: type(s).__name__)


@each_scene
def test_a_picture_is_linear_light_and_the_same_every_time(scene):
    one = scene.reflectance(0.0123)
    assert one.shape == SHAPE and one.dtype == np.float32
    assert one.min() >= 0 and one.max() <= 1
    assert one.max() - one.min() > 0.6  # a picture, not a grey plane
    one_again = scene.reflectance(0.0123)
    assert one_again is not one and np.array_equal(one, one_again)
    CANVASES[type(scene)].cache_clear()
    assert np.array_equal(one, scene.reflectance(0.0123))


@pytest.mark.parametrize("shape", [(8, 8), (64, 48), (250, 400), (9, 130)])
@pytest.mark.parametrize("kind", [Wave, Star])
def test_any_shape_shows_the_scene(kind, shape):
    scene = kind(shape)
    picture = scene.reflectance(0.01)
    assert picture.shape == shape and picture.std() > 0.02
    assert picture.min() >= 0 and picture.max() <= 1
    for row, column, label in scene.points():
        assert 0 <= row < shape[0] and 0 <= column < shape[1] and label


@pytest.mark.parametrize("kind", [Wave, Star])
def test_a_finer_grid_shows_the_same_light(kind):
    # Four pixels of the fine grid are one of the coarse: box means must agree but for edges.
    fine = kind((400, 400)).reflectance(0.004).astype(np.float64)
    mean = fine.reshape(200, 2, 200, 2).mean(axis=(1, 3))
    coarse = kind((200, 200)).reflectance(0.004)
    # Measured 0.005, 0.013, 0.023: square edges and lines near a pixel's width differ most.
    assert np.sqrt(np.mean((mean - coarse) ** 2)) < 0.03
    assert abs(mean.mean() - coarse.mean()) < 0.004


@each_scene
def test_what_is_kept_and_what_is_drawn_alone_equal_the_whole(scene):
    t = 0.0171
    whole = scene.reflectance(t)
    direct = CANVASES[type(scene)](scene).direct(t)
    # Front layers are kept as float32 gain and offset: two roundings of values below 1.
    assert np.abs(whole - direct).max() < 1e-6
    for box in ((0, 220, 0, 260), (13, 101, 40, 241), (90, 91, 7, 8), scene.moving(t, t + 1e-3)):
        y0, y1, x0, x1 = box
        assert np.array_equal(scene.patch(t, box), whole[y0:y1, x0:x1])
    with pytest.raises(ValueError, match=r"box must lie within \(0, 220, 0, 260\), not"):
        scene.patch(t, (0, 221, 0, 260))


@each_scene
@pytest.mark.parametrize("span", [25e-6, 1e-3, 0.3])
def test_nothing_changes_outside_the_moving_box(scene, span):
    for start in (0.0, 0.0334, 0.071):
        y0, y1, x0, x1 = scene.moving(start, start + span)
        first = scene.reflectance(start)
        changed = np.zeros(SHAPE, bool)
        for part in (0.06, 0.19, 0.31, 0.5, 0.69, 0.81, 0.94, 1.0):
            changed |= scene.reflectance(start + part * span) != first
        inside = changed[y0:y1, x0:x1].sum()
        assert inside > 0
        assert changed.sum() == inside


def test_the_moving_box_of_a_short_while_is_tight():
    wave = Wave(SHAPE)
    y0, y1, x0, x1 = wave.moving(0.0, 25e-6)
    changed = wave.reflectance(0.0) != wave.reflectance(25e-6)
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    assert rows[0] - y0 < 8 and y1 - rows[-1] < 8
    assert columns[0] - x0 < 12 and x1 - columns[-1] < 8
    assert wave.moving(0.5, 0.5) == (0, 0, 0, 0)
    assert Wave(SHAPE, rate=0.0).moving(0.0, 1.0) == (0, 0, 0, 0)
    with pytest.raises(ValueError, match=r"stop must be at or after start 1\.0, not 0\.0"):
        wave.moving(1.0, 0.0)


def test_the_moving_box_holds_what_happens_between_the_looks():
    # A disc that swings so that it is in the middle at each of the 9 instants looked at.
    def disc(t: float) -> list[Item]:
        x = 20.0 * math.sin(8 * math.pi * t)
        return [body([(x, 0.0, x, 0.0, 3.0, 3.0)], Surface(0.9))]

    speed = 20.0 * 8 * math.pi
    wall = Layer((body([(0.0, 0.0, 0.0, 0.0, 999.0, 999.0)], Surface(0.2, round=0.0)),))
    canvas = Canvas(View((80, 80), 80.0), (wall, Layer(items=disc, speed=speed)))
    y0, y1, x0, x1 = canvas.moving(0.0, 1.0)
    assert y0 <= 37 and y1 >= 43 and x0 <= 17 and x1 >= 63
    assert canvas.moving(0.0, 1e-3)[2] > 30  # and no more than it must


def beyond(scene, t: float, dt: float, radius: int) -> float:
    """Share of the picture that at t + dt lies outside what its neighbourhood holds at t."""
    size = 2 * radius + 1
    first, second = scene.reflectance(t), scene.reflectance(t + dt)
    # Turning surfaces change their shade without moving an edge; a line thinner than a pixel
    # brightens as it centres on one.
    slack = 0.06
    high = maximum_filter(first, size) + slack
    low = minimum_filter(first, size) - slack
    return float(((second > high) | (second < low)).mean())


@each_scene
def test_no_edge_outruns_the_stated_speed(scene):
    # Two pixels of way at the stated speed, and one for coverage. Four times as far must show, or
    # the test could not fail.
    dt = 2.0 / scene.speed()
    for t in (0.0, 0.019):
        assert beyond(scene, t, dt, 3) < 1e-4
    assert beyond(scene, 0.019, 4 * dt, 3) > 4e-4


@each_scene
def test_motion_is_smooth_below_a_pixel(scene):
    dt = 1e-3 / scene.speed()  # a thousandth of a pixel
    first = scene.reflectance(0.0203).astype(np.float64)
    once = np.abs(scene.reflectance(0.0203 + dt) - first)
    twice = np.abs(scene.reflectance(0.0203 + 2 * dt) - first)
    # A box filter has slope 1 a pixel at a white edge (1.5 with square spokes a pixel wide), and
    # float32 rounds by 6e-8.
    assert 1e-5 < once.max() < 4e-3
    assert abs(twice.sum() / once.sum() - 2) < 0.02


@pytest.mark.parametrize("kind", [Wave, Star])
def test_hours_do_not_blur_the_phase(kind):
    # Whole periods later the picture is the same, to what float64 holds of an hour (5e-13 s).
    first, later = kind(SHAPE).reflectance(0.0101), kind(SHAPE).reflectance(3600.0101)
    assert np.abs(first - later).max() < 1e-5


@pytest.mark.parametrize("kind", [Wave, Star])
def test_scenes_are_plain_values(kind):
    scene = kind(SHAPE)
    scene.reflectance(0.0)
    again = pickle.loads(pickle.dumps(scene))
    assert again == scene and hash(again) == hash(scene) and len(pickle.dumps(scene)) < 1000
    labels = [label for _, _, label in scene.points()]
    assert 8 <= len(labels) <= 12 and len(set(labels)) == len(labels)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Wave((7, 100)), r"shape must be \(height, width\), each 8 to 2000 pixels"),
        (lambda: Star((100, 2001)), "each 8 to 2000 pixels, not"),
        (lambda: Wave((100.5, 100)), "each 8 to 2000 pixels, not"),
        (lambda: Wave(SHAPE, rate=7.0), r"rate must be 0 to 6 Hz, not 7\.0"),
        (lambda: Wave(SHAPE, rate=math.nan), "rate must be 0 to 6 Hz, not nan"),
        (lambda: Star(SHAPE, spokes=1), "spokes must be 2 to 360, not 1"),
        (lambda: Star(SHAPE, spokes=2.5), r"spokes must be an integer, not 2\.5"),
        (lambda: Star(SHAPE, profile="saw"), 'profile must be "square" or "sine", not \'saw\''),
        (lambda: Star(SHAPE, mean=0.6), r"mean must be at most 1 / \(1 \+ contrast\) = 0\.5263"),
        (lambda: Wave(SHAPE).reflectance(math.inf), "t must be finite seconds, not inf"),
    ],
)
def test_bad_parameters_are_named(make, text):
    with pytest.raises(ValueError, match=text):
        make()


def ring(scene: Star, part: float) -> tuple[np.ndarray, np.ndarray]:
    """Mask of a ring ten pixels wide at this part of the radius; angle of its pixels. In a thin
    one the pixels' own places along the circle beat with the spokes."""
    h, w = scene.shape
    y, x = np.mgrid[0:h, 0:w] + 0.5
    y, x = y - h / 2, x - w / 2
    mask = np.abs(np.hypot(x, y) - part * RADIUS * min(h, w)) < 5
    return mask, np.arctan2(y, x)[mask]


@pytest.mark.parametrize("profile", ["square", "sine"])
def test_star_after_one_spoke_is_the_same_and_half_a_spoke_is_its_negative(profile):
    star = Star(SHAPE, profile=profile, phase=0.013)
    first = star.reflectance(0.002)
    period = 1 / (star.spokes * star.revolutions)
    # Phases are float32: 1e-6 of a period, here of 14 pixels at the rim.
    assert np.abs(star.reflectance(0.002 + period) - first).max() < 5e-5
    mask, _ = ring(star, 0.5)
    negative = star.reflectance(0.002 + period / 2)
    assert np.abs(negative[mask] + first[mask] - 2 * star.mean).max() < 5e-5
    assert np.abs(negative - first).max() > 0.8


@pytest.mark.parametrize("profile", ["square", "sine"])
@pytest.mark.parametrize("shape", [(400, 400), (301, 420)])
def test_star_edges_stand_where_the_angle_says(profile, shape):
    star = Star(shape, spokes=24, revolutions=-17.0, profile=profile, phase=0.21)
    for t in (0.0, 1 / 3000, 0.0123):
        mask, angle = ring(star, 0.9)
        wave = star.reflectance(t)[mask].astype(np.float64) - star.mean
        # The fundamental of either profile is sin(n (angle - turned)).
        found = np.angle(np.sum(wave * np.exp(-1j * star.spokes * angle))) + math.pi / 2
        turned = 2 * math.pi * (-17.0 * t + 0.21)
        slip = math.remainder(found + star.spokes * turned, 2 * math.pi) / star.spokes
        assert abs(slip) * 0.9 * RADIUS * min(shape) < 0.03  # pixels along the circle
        assert abs(math.remainder(star.angle(t) - turned, 2 * math.pi)) < 1e-9


def test_star_means_are_grey():
    star = Star((401, 401), mean=0.4, contrast=0.8)
    picture = star.reflectance(0.0007)
    for part in (0.2, 0.5, 0.8):
        mask, _ = ring(star, part)
        assert abs(picture[mask].mean() - 0.4) < 0.004, part
    assert picture[200, 200] == pytest.approx(0.4, abs=1e-3)  # spokes meet in one pixel
    near = picture[198:203, 198:203]
    assert abs(near - 0.4).max() < 0.15 and picture[mask].max() == pytest.approx(0.72, abs=1e-5)


@pytest.mark.parametrize(("profile", "rms", "most"), [("square", 0.03, 0.1), ("sine", 4e-4, 2e-3)])
def test_star_pixels_are_box_means(profile, rms, most):
    # The docstring's figures, where a period is 4 pixels or more; 32 x 32 points a pixel.
    size, n = 80, 36
    x = np.arange(size) - size / 2 + 0.5
    truth = np.zeros((size, size))
    steps = (np.arange(32) + 0.5) / 32 - 0.5
    for dy in steps:
        for dx in steps:
            a = n * np.arctan2(x[:, None] + dy, x[None, :] + dx) - 0.3 * 2 * math.pi
            truth += np.sin(a) if profile == "sine" else np.where(np.sin(a) >= 0, 1, -1)
    phase, width = star_module._phase(x[None, :], x[:, None], 1.0, n)
    error = star_module._wave(phase - 0.3, width, profile) - truth / 32**2
    error = error[np.hypot(x[None, :], x[:, None]) * 2 * math.pi / n >= 4]
    assert np.sqrt(np.mean(error**2)) < rms and np.abs(error).max() < most


def test_star_wedge_is_linear_and_still():
    star = Star((500, 500))
    points = {label: (row, column) for row, column, label in star.points()}
    for t in (0.0, 0.0113):
        picture = star.reflectance(t)
        for label, step in (("step 0.125", 0.125), ("step 0.5", 0.5), ("step 1", 1.0)):
            assert picture[points[label]] == pytest.approx(step, abs=1e-6)
        assert picture[points["black ring"]] < 0.03


def test_wave_forearm_follows_its_closed_form():
    wave = Wave((300, 300), rate=2.5, swing=0.9, phase=0.4)
    y, x = np.mgrid[0:300, 0:300] + 0.5
    # The arm at both ends of its way: what is brighter than either is the forearm in between (the
    # shadows on the wall are darker).
    ends = [wave.reflectance((p - 0.4) / (2 * math.pi * 2.5)) for p in (-math.pi / 2, math.pi / 2)]
    background = np.maximum(*ends)
    seen, stated = [], []
    for phase in (-0.35, -0.2, 0.0, 0.2, 0.35, math.pi, 5 * math.pi + 0.3):
        t = (phase - 0.4) / (2 * math.pi * 2.5)
        row, column = wave.joints(t)[1]
        r, a = np.hypot(x - column, y - row), np.arctan2(x - column, row - y)
        part = (wave.reflectance(t) - background > 0.04) & (r > 36) & (r < 52) & (np.abs(a) < 0.7)
        assert part.sum() > 200
        seen.append(np.median(a[part]))
        stated.append(0.10 + 0.9 * math.sin(2 * math.pi * 2.5 * t + 0.4))
        assert wave.angles(t)[1] == pytest.approx(stated[-1], abs=1e-9)
    # A limb's shaded side falls below the threshold everywhere alike, up to 4 of its 22 pixels at
    # 44 from the joint: an offset of up to 0.05 rad, and no error of the swing.
    slope, offset = np.polyfit(stated, seen, 1)
    rest = np.asarray(seen) - np.polyval((slope, offset), stated)
    assert max(stated) - min(stated) > 0.6
    assert slope == pytest.approx(1.0, abs=0.05) and abs(offset) < 0.05
    assert np.abs(rest).max() < 0.02


def test_wave_blurs_as_the_paper_says():
    # Section 6: blur after 10 ms, heavy after 40 ms. A fast human hand: below 10 m/s (assumed).
    wave = Wave((1000, 1000))
    palm = np.array([wave.joints(t)[3] for t in np.linspace(0.0, 0.04, 41)])
    way = np.hypot(*np.diff(palm, axis=0).T)
    assert way[15:25].sum() > 25 and way.sum() > 100
    metres = wave.field / 1000
    assert way.max() / 1e-3 < wave.speed() < 10 / metres


def test_wave_points_lie_where_they_say():
    wave = Wave((500, 500))
    film = np.stack([wave.reflectance(t) for t in np.linspace(0.0, 0.04, 21)])
    for row, column, label in wave.points():
        moves = label.startswith("where") or label in ("sleeve", "wrist")
        assert (np.ptp(film[:, row, column]) > 0.1) == moves, label
    light = {label: film[0, row, column] for row, column, label in wave.points()}
    assert light["hair"] < 0.12 < light["wall"] < light["sunlit wall"]
    assert light["forehead"] > 0.35 and light["eye"] < 0.2


def test_a_disc_covers_its_area_at_any_place_and_a_thin_line_its_width():
    view = View((64, 64), 64.0)  # one metre a pixel
    flat = Surface(1.0, round=0.0)
    for x, y in ((0.0, 0.0), (0.3, -0.21), (0.5, 0.47)):
        image = np.zeros((64, 64), np.float32)
        body([(x, y, x, y, 9.3, 9.3)], flat).draw(image, view.whole, view)
        # Coverage is linear in distance: a disc's area is pi (r^2 + 1/12), as for a box filter.
        assert image.sum() == pytest.approx(math.pi * (9.3**2 + 1 / 12), rel=1e-3)
        rows, columns = np.mgrid[0:64, 0:64] + 0.5
        assert (image * columns).sum() / image.sum() == pytest.approx(32 + x, abs=0.01)
        assert (image * rows).sum() / image.sum() == pytest.approx(32 + y, abs=0.01)
        image[:] = 0
        body([(-99.0, y, 99.0, y, 0.1, 0.1)], flat).draw(image, view.whole, view)
        assert image[:, 32].sum() == pytest.approx(0.2, rel=1e-6)


def test_cones_are_hulls_of_their_ends():
    # A round cone's outline is the hull of its two circles: all points between them are inside.
    view = View((80, 80), 80.0)
    image = np.zeros((80, 80), np.float32)
    body([(-18.0, 4.0, 20.0, -9.0, 5.0, 11.0)], Surface(1.0, round=0.0)).draw(
        image, view.whole, view
    )
    y, x = np.mgrid[0:80, 0:80] - 39.5
    hull = np.full((80, 80), np.inf)
    for s in np.linspace(0, 1, 400):
        d = np.hypot(x - (-18 + 38 * s), y - (4 - 13 * s)) - (5 + 6 * s)
        hull = np.minimum(hull, d)
    assert np.abs(image - np.clip(0.5 - hull, 0, 1)).max() < 0.01
    assert capsules([(0, 0, 1, 0, 5, 1)])[0, 4] == 0.0  # one end holds the other: a disc


def test_square_mean_is_the_mean_of_a_square_wave():
    phase = np.linspace(-2.3, 3.1, 41)
    for width in (0.013, 0.4, 1.0, 3.7):
        points = phase[:, None] + width * ((np.arange(20000) + 0.5) / 20000 - 0.5)
        truth = (points % 1 < 0.5).mean(axis=1)
        assert np.abs(square_mean(phase, width) - truth).max() < 2e-4


def test_noise_is_smooth_fixed_and_fills_its_range():
    x, y = np.meshgrid(np.linspace(-40, 40, 800), np.linspace(-7, 60, 700))
    values = noise(x, y, 3)
    assert values.min() >= 0 and values.max() < 1
    assert values.mean() == pytest.approx(0.5, abs=0.03) and values.std() > 0.15
    assert np.abs(np.diff(values, axis=1)).max() < 0.25  # no steps at cell borders
