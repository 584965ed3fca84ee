"""The stage: light in time, rows that are late, splits, occlusion, fog over a whole image."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cosim import PS, Block, Clock, Light, Piece
from link.air import Aim, f_number_for, image_of, levels
from sensor import SpikeCamera
from tests.link.air.scenes import AIR, CAMERA, CLOCK, FIRST, OPTICS, PANEL, SHAPE, Shown, make

BUSY = {
    "aim": Aim((2.0, 1.0), 5.0, (3.0, -2.0), vibration=0.4, vibration_frequency=900.0),
    "air": replace(AIR, ambient=500.0, structure=1e-9, visibility=30.0),
}


def test_planes_come_when_the_panels_clock_says() -> None:
    clock = Clock(40_004)
    air = make(Shown(level=True), 6, panel=replace(PANEL, clock=clock))
    light = air.step(None, Block(0, 16))
    on = light.at(FIRST)[24, 32]
    assert light.at(FIRST - 1)[24, 32] == 0
    end = FIRST + clock.edge(6)
    assert light.at(end - 1)[24, 32] == on > 0
    assert light.at(end)[24, 32] == 0
    assert len(light.pieces) == 5  # dark, three symbols, dark
    assert light.integral(0, CLOCK.edge(18))[24, 32] == pytest.approx(on * (end - FIRST) / PS)


@pytest.mark.parametrize("slow", [0.0, 12e-6])
def test_light_does_not_depend_on_blocks(slow: float) -> None:
    panel = replace(PANEL, rise=slow, decay=2 * slow, clock=Clock(39_990))
    whole = make(panel=panel, **BUSY).step(None, Block(0, 32))
    air = make(panel=panel, **BUSY)
    for start, size in ((0, 7), (7, 1), (8, 16), (24, 8)):
        part = air.step(None, Block(start, size))
        for cycle in range(max(start - 1, 0), start + size + 1):
            middle = CLOCK.middle(cycle)
            assert np.array_equal(part.at(middle), whole.at(middle))
        again = make(panel=panel, **BUSY)
        again.restore(air.state())
        if start + size < 32:
            following = again.step(None, Block(start + size, 2))
            assert np.array_equal(
                following.at(CLOCK.edge(start + size) + 5), whole.at(CLOCK.edge(start + size) + 5)
            )


def test_planes_of_a_symbol_are_one_piece() -> None:
    light = make(Shown(ticks=4), 24).step(None, Block(0, 32))
    assert [p.stop - p.start for p in light.pieces[1:-1]] == [4 * PS // 40_000] * 6
    assert all(p.constant for p in light.pieces)


def test_a_slow_emitter_is_the_displays_own() -> None:
    """One plane on, then dark: what it has emitted by the end of plane n is the closed form."""
    rise, decay = 20e-6, 35e-6
    panel = replace(PANEL, rise=rise, decay=decay)

    class Once(Shown):
        def pixels(self, symbol: int) -> np.ndarray:
            return np.full(self.shape, symbol == 0)

    air = make(Once(ticks=1), 8, panel=panel, effects=["emitter response"])
    light = air.step(None, Block(0, 16))
    steady = levels(OPTICS, AIR).on
    tick, level = 25e-6, 0.0
    for plane in range(8):
        drive, constant = (1.0, rise) if plane == 0 else (0.0, decay)
        gone = -math.expm1(-tick / constant)
        mean = drive + (level - drive) * constant / tick * gone
        level += (drive - level) * gone
        found = light.at(FIRST + CLOCK.middle(plane))[24, 32]
        assert found == pytest.approx(steady * mean, rel=1e-5)


def test_scanning_in_step_cancels() -> None:
    """Rows of the panel that are late as the camera's rows are: every row sees the same times."""
    camera = replace(CAMERA, row_skew=1.0)
    wide = replace(OPTICS, width=80, height=64)
    panel = replace(PANEL, shape=(64, 80), row_scan=1.0)
    air = make(Shown(shape=(64, 80)), optics=wide, panel=panel, camera=camera)
    homography = image_of(wide, Aim(), AIR, SHAPE)
    rows = (np.arange(SHAPE[0]) - homography[1, 2]) / homography[1, 1]
    exact = np.clip(rows, 0, 63) / 64 * PS / 40_000
    assert np.abs(air.row_delay - exact).max() <= 1
    # A flash of one cycle in the panel's time is all of one cycle for a row in step.
    flash = np.full(SHAPE, 1e4, np.float32)
    dark = np.zeros(SHAPE, np.float32)
    edges = [0, CLOCK.edge(6), CLOCK.edge(7), CLOCK.edge(20)]
    light = Light(
        tuple(
            Piece(a, b, x, x)
            for a, b, x in zip(edges[:-1], edges[1:], (dark, flash, dark), strict=True)
        )
    )
    step = np.arange(SHAPE[0]) * (PS // 40_000) // SHAPE[0]
    words = SpikeCamera(camera, None, row_delay=step).step(light, Block(0, 16)).words[0]
    assert (words == words[0, 0]).all()
    assert words[0, 0] != 0
    skewed = SpikeCamera(camera, None).step(light, Block(0, 16)).words[0]
    assert not (skewed == skewed[0]).all()


def test_late_moves_a_rows_sampling() -> None:
    """Light that comes two thirds of a cycle late, told by `late` or by the light itself."""
    rng = np.random.default_rng(5)
    planes = [rng.uniform(50, 400, SHAPE).astype(np.float32) for _ in range(21)]
    cycle = PS // 40_000
    by = cycle * 2 // 3

    def shown(shift: int) -> Light:
        starts = [0, *(CLOCK.edge(n) + shift for n in range(1, 21)), CLOCK.edge(24)]
        return Light(
            tuple(
                Piece(a, b, x, x) for a, b, x in zip(starts[:-1], starts[1:], planes, strict=True)
            )
        )

    told = SpikeCamera(CAMERA, None, row_delay=np.full(SHAPE[0], by)).step(shown(0), Block(0, 20))
    made = SpikeCamera(CAMERA, None).step(shown(by), Block(0, 20))
    assert np.array_equal(told.words, made.words)
    assert not np.array_equal(
        told.words, SpikeCamera(CAMERA, None).step(shown(0), Block(0, 20)).words
    )
    with pytest.raises(ValueError, match="row_delay must be"):
        SpikeCamera(CAMERA, None, row_delay=np.zeros(3, np.int64))


def test_a_hidden_part_is_as_bright_as_the_surroundings() -> None:
    lit = replace(AIR, ambient=1000.0, glare=0.0)
    air = make(Shown(level=True), air=lit, aim=Aim(occluded=0.5))
    image = air.step(None, Block(2, 2)).at(FIRST + 1)
    around = image[0, 0]
    assert around == pytest.approx(
        levels(replace(OPTICS, luminance=0.18 * 1000 / math.pi), replace(lit, ambient=0.0)).on
    )
    assert image[24, 22] == pytest.approx(around, rel=1e-5)
    assert image[24, 42] == pytest.approx(levels(OPTICS, lit).on, rel=1e-4)


def test_fog_leaves_an_even_world_even() -> None:
    """Where everything is as bright as the fog, nothing is seen, however thick it is."""
    even = replace(AIR, ambient=1000.0, surroundings=1.0, visibility=4.0, glare=0.0)
    bright = replace(OPTICS, luminance=1000 / math.pi, reflectance=0.0)
    image = make(Shown(level=True), optics=bright, air=even).step(None, Block(2, 2)).at(FIRST + 1)
    clear = levels(bright, replace(even, ambient=0.0, visibility=None)).on
    # The halo's grid darkens towards the sensor's edge, beyond which nothing is known.
    assert image[20:28, 28:36] == pytest.approx(np.full((8, 8), clear), rel=2e-3)


def test_f_number_for_a_level() -> None:
    gain = CAMERA.electrons_per_lux
    number = f_number_for(1.4, OPTICS, 2.0, 1000.0, gain, CLOCK)
    lit = levels(replace(OPTICS, f_number=number), AIR).on
    assert lit * gain / 40_000 == pytest.approx(1400)
    with pytest.raises(Exception, match=r"link.aim.on_level must be at most"):
        f_number_for(1.4, replace(OPTICS, luminance=1.0), 2.0, 1000.0, gain, CLOCK)


BEAMS = {
    "plain": {"aim": Aim((2.0, 1.0), 5.0, vibration=0.4), "air": replace(AIR, ambient=500.0)},
    "tilted": {"aim": Aim((0.0, 0.0), 0.0, (20.0, -15.0)), "air": replace(AIR, sun=2e4)},
    "fog": {"air": replace(AIR, ambient=500.0, visibility=30.0)},
    "blurred": {"optics": replace(OPTICS, blur=1.7)},
    "out of focus": {"optics": replace(OPTICS, focus=1.2)},
}


@pytest.mark.parametrize("beam", BEAMS)
def test_patches_alone_have_the_light_of_the_whole_plane(beam: str) -> None:
    """Every bit of it, at the chip's corners and over its edges too."""
    boxes = [(0, 12, 0, 12), (36, 48, 52, 64), (18, 30, 26, 38)]
    y = np.clip([range(a - 1, b + 1) for a, b, _, _ in boxes], 0, SHAPE[0] - 1)
    x = np.clip([range(a - 1, b + 1) for _, _, a, b in boxes], 0, SHAPE[1] - 1)
    whole = make(**BEAMS[beam]).step(None, Block(0, 16))
    parts = make(**BEAMS[beam], places=(y, x)).step(None, Block(0, 16))
    assert len(parts.pieces) == len(whole.pieces) > 3
    for one, two in zip(whole.pieces, parts.pieces, strict=True):
        assert (one.start, one.stop) == (two.start, two.stop)
        cut = np.concatenate([one.first[np.ix_(a, b)] for a, b in zip(y, x, strict=True)])
        assert np.array_equal(cut, two.first)
    assert parts.pieces[1].first.std() > 0


def test_glare_is_the_mean_of_the_whole_image() -> None:
    """Made from the panel's side, it is that of the image's pixels."""
    busy = replace(AIR, ambient=500.0, glare=0.2)
    aim = Aim((14.0, 6.0), 20.0, (25.0, 10.0))  # a part of the panel is out of view
    with_it, without = (
        make(aim=aim, air=replace(busy, glare=g)).step(None, Block(0, 8)).pieces for g in (0.2, 0.0)
    )
    for one, two in zip(with_it, without, strict=True):
        exact = 0.8 * two.first + 0.2 * two.first.mean(dtype=np.float64)
        assert np.allclose(one.first, exact, rtol=2e-6)
