"""What a chip says beyond its spikes, in its stream: rejection, charges and writes, block by block
and from a state, against plain numpy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cosim import Block, Clock, Viform
from cosim.spikes.ancillary import ChargePlane, RegisterWrite
from cosim.spikes.viform import pack_planes, unpack_planes
from cosim.stage import blocks
from sensor.latched.ancillary import AncillaryStage, registers_of, writes_of
from sensor.latched.writes import Phase, Registers, Write, phases_of
from sensor.reconstruct.readings import Readings

SHAPE, CYCLES = (7, 9), 300
CLOCK = Clock(40_000)
RANDOM = np.random.default_rng(11)
PLANES = RANDOM.random((CYCLES, *SHAPE)) < RANDOM.random(SHAPE) ** 6
READINGS = Readings(
    np.arange(8, dtype=np.int64) * 40,
    RANDOM.integers(0, 101, (8, *SHAPE)).astype(np.uint16), 100,
)  # fmt: skip
PHASES = phases_of([Write(50, 500.0), Write(128, 250.0, (2, 5))], 1000.0, SHAPE[0])
NOMINAL = (Phase(0, 1000.0, (0, SHAPE[0])),)


def part(first: int, cycles: int) -> Viform:
    return Viform(pack_planes(PLANES[first : first + cycles]), cycles, CLOCK, first)


def told(make: Any, size: int, cut: int = 0) -> tuple[Any, list[Any], int]:
    """Planes and ancillary data behind a stage, in blocks of a size; from a state at `cut`."""
    stage, planes, said = make(), [], []
    for each in blocks(CYCLES, size):
        if cut and each.start == cut:
            later = make()
            later.restore(stage.state())
            stage = later
        out = stage.step(part(each.start, each.cycles), Block(each.start, each.cycles))
        planes.append(unpack_planes(out.words, 0, each.cycles))
        said += out.ancillary
        assert all(each.start <= one.cycle < each.stop for one in out.ancillary)
    return np.concatenate(planes), said, stage.rejected


@pytest.mark.parametrize(("size", "cut"), [(32, 0), (64, 128), (96, 192), (300, 0)])
@pytest.mark.parametrize("dark", [2.0, 7.5, 40.0])
def test_intervals_of_the_dark_are_left_out(dark: float, size: int, cut: int) -> None:
    planes, said, rejected = told(
        lambda: AncillaryStage(SHAPE, NOMINAL, 1000.0, None, dark), size, cut
    )
    age, expected = np.zeros(SHAPE), np.zeros_like(PLANES)
    for n, plane in enumerate(PLANES):
        age += 1
        expected[n] = plane & (age < dark)
        age[plane] = 0
    np.testing.assert_array_equal(planes.astype(bool), expected)
    assert rejected == PLANES.sum() - expected.sum() > 0 and not said


@pytest.mark.parametrize(("size", "cut"), [(32, 64), (64, 0), (300, 0)])
@pytest.mark.parametrize("dark", [math.inf, 100.0])
def test_planes_of_charges_are_differences_of_pixels_that_do_not_fire(
    dark: float, size: int, cut: int
) -> None:
    """Those of `Readings.rate`, which `viform image` shows; without a light whose interval would be
    rejected: 40 levels of 100 in 40 cycles are 0.01 spikes a cycle, as an interval of 100."""
    _, said, _ = told(lambda: AncillaryStage(SHAPE, NOMINAL, 1000.0, READINGS, dark), size, cut)
    assert [each.cycle for each in said] == [40, 80, 120, 160, 200, 240, 280]
    stream = Viform(pack_planes(PLANES), CYCLES, CLOCK)
    for each in said:
        read, rate = READINGS.rate(stream, each.cycle - 1)
        assert isinstance(each, ChargePlane) and (each.span, each.levels) == (40, 100)
        light = np.where(read & (rate > 1 / dark), rate, 0)
        np.testing.assert_allclose(each.gain / 4000, light, rtol=1e-5)
    assert sum((each.gain > 0).sum() for each in said) > 20


def test_writes_hold_from_their_cycles() -> None:
    _, said, _ = told(lambda: AncillaryStage(SHAPE, PHASES, 1000.0, None, math.inf), 64)
    assert said == [RegisterWrite(50, 0.5, (0, 7)), RegisterWrite(128, 0.25, (2, 5))]
    assert writes_of(NOMINAL, 1000.0, 7) == ()
    # A level below the nominal one from the first cycle on.
    low = (Phase(0, 750.0, (0, 7)),)
    assert writes_of(low, 1000.0, 7) == (RegisterWrite(0, 0.75, (0, 7)),)
    found, known = registers_of(said, 7), Registers(PHASES, 1000.0, 7)
    assert found is not None and registers_of([], 7) is None
    for span in ((0, 50), (40, 60), (100, 200)):
        np.testing.assert_allclose(found.shares(*span), known.shares(*span))
        assert found.rows(*span) == known.rows(*span)
    # Of a part of the stream, the registers that hold in its first cycle.
    stream = Viform(pack_planes(PLANES), CYCLES, CLOCK, 0, tuple(said))[70:, 1:4]
    assert stream.ancillary == (RegisterWrite(70, 0.5, (0, 3)), RegisterWrite(128, 0.25, (1, 3)))
    later = registers_of(stream.ancillary, 3, stream.start)
    assert later is not None and later.phases[0] == Phase(0, 0.5, (0, 3))
