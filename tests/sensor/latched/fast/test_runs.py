"""What kernels need of the course of light is kept without its planes."""

from __future__ import annotations

import weakref
from dataclasses import replace

import numpy as np
import pytest

from cosim import PS, Clock, Light, Piece
from cosim.compute.opencl import Device
from sensor.latched.effects import EFFECTS
from sensor.latched.fast import FastPixels, PixelArray
from sensor.latched.fast.runs import LaunchCache, Launches, launches_of
from sensor.latched.pixel.model import ExactModel
from sensor.latched.sampling import row_offsets
from tests.sensor.latched.piecewise import level

CLOCK = Clock(40_000)
PERIOD = PS // 40_000
SHAPE = (7, 45)
NUMBERS = np.arange(SHAPE[0] * SHAPE[1], dtype=np.uint32)


def array_of(seed: int = 1) -> PixelArray:
    model = ExactModel(300.0, seed, tuple(EFFECTS.values()))
    offsets = row_offsets(CLOCK, 7, 0.8, 10e-6, (0, 7))
    return PixelArray(model, SHAPE, NUMBERS, CLOCK, 300.0 * 40_000 / 900, None, offsets)


def ramps(seed: int, ends: tuple[int, ...] = (0, 401, 977, 1500), constant: bool = False) -> Light:
    """Light between random planes at these instants, percent of a cycle; the last piece lasts."""
    planes = [level(SHAPE, seed + n, 700.0) for n in range(len(ends))]
    instants = [end * PERIOD // 100 for end in ends]
    pieces = [
        Piece(a, b, one, one if constant else two)
        for a, b, one, two in zip(instants, instants[1:], planes, planes[1:], strict=False)
    ]
    last = pieces[-1].last
    return Light((*pieces, Piece(instants[-1], 200 * PERIOD, last, last)))


def assert_equal(one: Launches, two: Launches) -> None:
    assert one.box == two.box and one.steady is two.steady and len(one.runs) == len(two.runs)
    for a, b in zip(one.runs, two.runs, strict=True):
        np.testing.assert_array_equal(a.entries, b.entries)
        np.testing.assert_array_equal(a.weights, b.weights)
        assert a.rows == b.rows and all(p is q for p, q in zip(a.planes, b.planes, strict=True))


def test_light_of_the_same_instants_has_the_same_weights_and_its_own_planes() -> None:
    array, asked = array_of(), []

    def course(light: Light, start: int, cycles: int):
        asked.append(start)
        return array.course(light, start, cycles)

    kept = LaunchCache(course)
    for seed in range(3):
        light = ramps(10 * seed)
        assert_equal(kept(light, 3, 60), launches_of(array.course(light, 3, 60)))
    assert asked == [3]
    # Other cycles, other instants, and planes that are the same at both ends are others.
    others = [
        (ramps(0), 3, 61), (ramps(0), 4, 60), (ramps(0, (0, 402, 977, 1500)), 3, 60),
        (ramps(0, constant=True), 3, 60),
    ]  # fmt: skip
    for light, start, cycles in others:
        assert_equal(kept(light, start, cycles), launches_of(array.course(light, start, cycles)))
    assert len(asked) == 1 + len(others)


def test_planes_are_not_kept() -> None:
    kept, light = LaunchCache(array_of().course), ramps(1)
    plane = weakref.ref(light.pieces[1].last)
    assert kept(light, 0, 30).runs
    del light
    assert plane() is None


def test_a_cycle_of_many_pieces_is_computed_anew() -> None:
    """Its light becomes a plane of its own, which belongs to these planes alone."""
    kept, ends = LaunchCache(array_of().course), (0, *range(300, 390, 4), 900)
    one, two = kept(ramps(1, ends), 0, 9), kept(ramps(50, ends), 0, 9)
    shown = [plane for run in two.runs for plane in run.planes]
    assert shown and not {id(plane) for run in one.runs for plane in run.planes} & set(
        map(id, shown)
    )


@pytest.mark.parametrize("first", [1, 2])
def test_cameras_of_other_seeds_share_what_is_kept(device: Device, first: int) -> None:
    """A camera whose launches are those that another has made has the bits of one of its own."""
    array, other = array_of(), array_of(2)
    light, later = ramps(first), ramps(7)
    pixels = FastPixels(array, device)
    pixels.expose(light, 0, 90)
    seeded = FastPixels(array.seeded(replace(array.model, seed=2), None), device, pixels)
    alone = FastPixels(other, device)
    np.testing.assert_array_equal(seeded.expose(later, 0, 90), alone.expose(later, 0, 90))
