"""The stage that shows a scene's light on other panels, and its slow motion."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import PS, Block, Clock, Light, Piece
from cosim.report.png import for_display
from cosim.stage import blocks
from display import CameraPlane
from display.observe.integration import LightPlanes, Span
from display.observe.slow_motion import Film, SlowMotion
from display.panels.panel import FramePanel
from display.references.stage import TRUTH, ReferenceStage
from display.section import DisplaySection
from scenarios.scenes.charts.chart import PURSUIT, STRIPS, Chart
from scenarios.scenes.drawing.analytic import AnalyticSource
from sensor.latched.stages import SceneStage

MS = PS // 1000
CLOCK = Clock(40_000)
CYCLES = 640
END = CLOCK.edge(CYCLES)
SHAPE = (100, 200)
SECTION = DisplaySection.model_validate(
    {"beside": ("120 Hz", "1000 Hz", "120 Hz"), "exposure": "2 ms"}
)
AT = (CLOCK.middle(320),)
NAMES = ["truth", "120 Hz", "1000 Hz", "16 kHz binary"]


def stage() -> ReferenceStage:
    observers = SECTION.observers(AT, END, PURSUIT)
    motion = SlowMotion(SHAPE, 0, END, MS // 2, 2)
    return ReferenceStage(
        SECTION.reference_panels(), observers, SHAPE, 700.0, CLOCK, CYCLES, motion
    )


def run(made: ReferenceStage, size: int = 64, reach: tuple[int, int] = (0, 0)) -> ReferenceStage:
    scene = SceneStage(AnalyticSource(Chart(SHAPE), 700.0, CLOCK), reach)
    for block in blocks(CYCLES, size):
        light = scene.step(None, block)
        assert made.step(light, block) is light
    return made


@pytest.fixture(scope="module")
def whole() -> ReferenceStage:
    return run(stage())


def test_every_panel_is_seen_by_every_observer(whole):
    images = whole.images()
    assert list(images) == NAMES
    for seen in images.values():
        assert list(seen) == ["eye", "pursuit", "camera"]
        assert all(i.shape == (1, *SHAPE) and i.dtype == np.float32 for i in seen.values())


def test_an_eye_that_pursues_sees_the_truth_stand_still(whole):
    truth = Chart(SHAPE).reflectance(AT[0] / PS)
    rows = slice(*(round(part * SHAPE[0]) for part in STRIPS[0][:2]))
    # Columns that the eye sees from beginning to end: it passes 32 pixels before and after.
    middle = (rows, slice(40, 160))
    images = whole.images()
    error = {
        name: np.sqrt(np.mean((images[name]["pursuit"][0][middle] - truth[middle]) ** 2))
        for name in NAMES
    }
    assert error["truth"] < error["1000 Hz"] < error["120 Hz"]
    # The light itself runs linearly between pictures a pixel apart, which rounds small letters.
    assert error["truth"] < 0.05 and error["120 Hz"] > 3 * error["truth"]
    still = images["truth"]["eye"][0][middle]
    assert np.std(still, axis=1).mean() < 0.5 * np.std(truth[middle], axis=1).mean()


def test_what_stands_still_is_the_same_on_all(whole):
    truth = Chart(SHAPE).reflectance(0.0)[: round(0.3 * SHAPE[0])]
    for name in NAMES[:3]:
        image = whole.images()[name]["eye"][0, : len(truth)]
        np.testing.assert_allclose(image, truth, rtol=1e-5)


def test_neither_blocks_nor_light_beyond_them_show(whole):
    other = run(stage(), 100, (3, 5))
    for name, seen in whole.images().items():
        for who, image in seen.items():
            # float32 sums of some hundred terms, in another order
            np.testing.assert_allclose(other.images()[name][who], image, rtol=0, atol=2e-6)
    for name, film in whole.films.items():
        worst = np.abs(film.frames.astype(int) - other.films[name].frames.astype(int)).max()
        assert worst <= 1


def test_it_goes_on_from_a_state(whole):
    first, second = stage(), stage()
    source = AnalyticSource(Chart(SHAPE), 700.0, CLOCK)
    halves = list(blocks(CYCLES, 64))
    for block in halves[:3]:
        first.step(source.step(None, block), block)
    second.restore(first.state())
    for block in halves[3:]:
        second.step(source.step(None, block), block)
    for name, seen in whole.images().items():
        for who, image in seen.items():
            assert np.array_equal(second.images()[name][who], image)
        assert np.array_equal(second.films[name].frames, whole.films[name].frames)
        assert second.films[name].done == 32


def test_slow_motion_of_the_truth_is_the_scene(whole):
    film = whole.films[TRUTH]
    assert film.frames.shape == (32, 50, 100) and film.done == 32
    source = AnalyticSource(Chart(SHAPE), 700.0, CLOCK)
    for n in (0, 9, 31):
        light = source.step(None, Block(20 * n, 20))
        mean = light.integral(n * MS // 2, (n + 1) * MS // 2) / 5e-4 / 700
        small = for_display(mean.reshape(50, 2, 100, 2).mean(axis=(1, 3)))
        assert np.abs(film.frames[n].astype(int) - small).max() <= 1
    held = whole.films["120 Hz"].frames
    assert np.array_equal(held[1], held[15]) and not np.array_equal(held[15], held[17])


def test_another_display_keeps_its_frames_in_the_same_way():
    motion = SlowMotion((4, 6), 10 * MS, 20 * MS, 3 * MS, 2)
    assert (motion.count, motion.shape) == (3, (2, 3))
    assert motion.touched(0, 10 * MS) == (0, 0)
    assert motion.touched(12 * MS, 14 * MS) == (0, 2)
    assert motion.touched(19 * MS, 90 * MS) == (3, 3)
    assert motion.camera(1, 3) == CameraPlane((14_500 * MS // 1000, 17_500 * MS // 1000), 3 * MS)
    plane = np.random.default_rng(1).random((4, 6)).astype(np.float32)
    kept, added = Film(motion), Film(motion)
    added.add(LightPlanes(plane[None], [Span(0, 0, 30 * MS)]))
    added.close(13 * MS)
    assert added.done == 1 and not added.frames[1].any()
    kept.keep(0, plane)
    expected = for_display(plane.reshape(2, 2, 3, 2).mean(axis=(1, 3)))
    assert np.array_equal(kept.frames[0], expected)
    assert np.abs(added.frames[0].astype(int) - expected).max() <= 1
    with pytest.raises(ValueError, match="exposure must be 1 to 10 ps, not 11 ps"):
        SlowMotion((4, 6), 0, 10, 11)
    with pytest.raises(ValueError, match="by must be 1 to 4, not 5"):
        SlowMotion((4, 6), 0, 10, 5, 5)


def test_panels_without_slow_motion_film_nothing():
    made = ReferenceStage([FramePanel(Clock(60))], {}, SHAPE, 700.0, CLOCK, CYCLES)
    plane = np.zeros(SHAPE, np.float32)
    light = Light((Piece(0, 2**62, plane, plane),))
    assert made.step(light, Block(0, CYCLES)) is light
    assert made.films == {} and made.images() == {"truth": {}, "60 Hz": {}}
