"""Exposure: exact integrals for any knots and any split, with and without the changed box."""

from __future__ import annotations

import itertools
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import PS, Block, Clock, Light, Piece
from cosim.compute.opencl import open_device
from sensor import CHIPS, CameraSetting, SpikeCamera
from sensor.device.pattern import DevicePattern
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import LARGEST, ONE
from sensor.latched.sampling import row_offsets
from tests.sensor.latched.piecewise import charges, level, light_between

CLOCK = Clock(40_000)
PERIOD = PS // 40_000
SHAPE = (3, 5)
plane = partial(level, SHAPE)
pieces = partial(light_between, SHAPE)


@settings(max_examples=60, deadline=None)
@given(
    inner=st.lists(st.integers(1, 20 * PERIOD - 1), max_size=8, unique=True),
    jumps=st.booleans(),
)
def test_charge_of_every_cycle_is_the_integral_of_its_light(inner: list[int], jumps: bool) -> None:
    light = pieces([0, *sorted(inner), 20 * PERIOD], jumps)
    gain = 2.86e5
    found = charges(Exposure(CLOCK, gain), light, 0, 20) / ONE
    for cycle in range(20):
        exact = light.integral(CLOCK.edge(cycle), CLOCK.edge(cycle + 1)).ravel() * gain
        # A ramp's slope is truncated once and used for up to 20 cycles.
        assert np.allclose(found[cycle], exact, rtol=1e-9, atol=40 / ONE)
    assert (found >= 0).all()


@settings(max_examples=30, deadline=None)
@given(
    inner=st.lists(st.integers(1, 40 * PERIOD - 1), max_size=6, unique=True),
    cuts=st.lists(st.integers(1, 39), max_size=5, unique=True),
)
def test_charges_do_not_depend_on_how_the_run_is_split(inner: list[int], cuts: list[int]) -> None:
    light = pieces([0, *sorted(inner), 40 * PERIOD], True)
    whole = charges(Exposure(CLOCK, 1e5), light, 0, 40)
    edges = [0, *sorted(cuts), 40]
    parts = [charges(Exposure(CLOCK, 1e5), light, a, b - a) for a, b in itertools.pairwise(edges)]
    assert np.array_equal(np.concatenate(parts), whole)


def test_a_knot_off_the_clock_mixes_its_cycle_exactly() -> None:
    dark, bright = np.zeros(SHAPE, np.float32), np.full(SHAPE, 100, np.float32)
    at = 7 * PERIOD + PERIOD // 4
    light = Light((Piece(0, at, dark, dark), Piece(at, 20 * PERIOD, bright, bright)))
    found = charges(Exposure(CLOCK, 40_000.0), light, 0, 20)[:, 0] / ONE
    assert found[:7].tolist() == [0] * 7
    assert found[7] == pytest.approx(75, abs=1e-9)
    assert (found[8:] == 100).all()


def test_the_changed_box_saves_work_and_changes_no_bit() -> None:
    base = plane(1)
    planes = [base]
    boxes = [(0, 2, 1, 4), (1, 3, 0, 2), (0, 1, 0, 1)]
    for n, (y0, y1, x0, x1) in enumerate(boxes):
        moved = planes[-1].copy()
        moved[y0:y1, x0:x1] = plane(10 + n)[y0:y1, x0:x1]
        planes.append(moved)
    knots = [0, 4 * PERIOD, 8 * PERIOD, 12 * PERIOD]

    def light(hint: bool) -> Light:
        return Light(
            tuple(
                Piece(knots[n], knots[n + 1], planes[n], planes[n + 1], boxes[n] if hint else None)
                for n in range(3)
            )
        )

    with_box = charges(Exposure(CLOCK, 3e4), light(True), 0, 12)
    assert np.array_equal(with_box, charges(Exposure(CLOCK, 3e4), light(False), 0, 12))
    assert len(np.unique(with_box[:, 0])) > 1


def test_a_fade_to_black_never_goes_below_zero() -> None:
    dark = np.zeros(SHAPE, np.float32)
    for cycles in (3, 7, 64, 1600):
        light = Light((Piece(0, cycles * PERIOD, plane(3, 1e6), dark),))
        found = charges(Exposure(CLOCK, 1e6), light, 0, cycles)
        assert (found >= 0).all() and found.any()


def test_light_beyond_the_fixed_point_is_held_and_bad_light_refused() -> None:
    much = np.full(SHAPE, 1e9, np.float32)
    found = charges(Exposure(CLOCK, 1e6), Light((Piece(0, PERIOD * 4, much, much),)), 0, 4)
    assert (found == LARGEST * ONE).all()
    for bad in (-1.0, float("nan")):
        level = np.full(SHAPE, bad, np.float32)
        with pytest.raises(ValueError, match="light must be 0 or more"):
            Exposure(CLOCK, 1.0).spans(Light((Piece(0, PERIOD, level, level),)), 0, 1)
    with pytest.raises(ValueError, match="light must cover"):
        Exposure(CLOCK, 1.0).spans(Light((Piece(0, PERIOD, much, much),)), 0, 2)


def test_the_papers_example_is_3_5_ns() -> None:
    # Huang 2022 section 4.3: 1e5 lux on 100 um2 at QE 0.7 fill 100 electrons in 3.5 ns.
    setting = CameraSetting(CHIPS["spiketwo"], CLOCK, 100.0, 1)
    seconds = 100 / (1e5 * setting.electrons_per_lux)
    assert seconds == pytest.approx(3.5e-9, rel=0.01)
    assert setting.rate(1e5) == pytest.approx(float(Fraction(1, 40_000)) / seconds)


def test_rows_of_a_chip_simulated_alone_are_the_rows_of_the_whole() -> None:
    setting = CameraSetting(CHIPS["spikeone"], CLOCK, 300.0, 4)
    device = open_device()
    level = (np.random.default_rng(2).random((250, 400)) * 60).astype(np.float32)
    later = (np.random.default_rng(3).random((250, 400)) * 60).astype(np.float32)

    def film(rows: slice) -> Light:
        return Light((Piece(0, 100 * PERIOD, level[rows], later[rows]),))

    whole = SpikeCamera(setting, device).step(film(slice(None)), Block(0, 100))
    part = SpikeCamera(setting, None, rows=(101, 130)).step(film(slice(101, 130)), Block(0, 100))
    assert np.array_equal(part.words, whole.words[:, 101:130])
    assert 0.05 < np.bitwise_count(whole.words).sum() / (100 * 100_000) < 0.95
    with pytest.raises(ValueError, match="light must fall on"):
        SpikeCamera(setting, device).step(film(slice(0, 10)), Block(0, 100))


def test_every_number_of_a_chip_says_where_it_is_from() -> None:
    for chip in CHIPS.values():
        said = chip.provenance()
        assert set(said.values()) <= {"published", "assumed"}
        assert said["quantum_efficiency"] == "assumed"
        assert said["width"] == ("assumed" if chip.name == "spikeasync" else "published")
        assert chip.assumed <= set(said)


def test_a_flash_shorter_than_a_cycle_may_be_brighter_than_a_cycle_can_hold() -> None:
    # 1 ns of 3e12 e/s is 3000 e; a whole cycle of it, 7.5e7 e, would be clipped to 2^21 e.
    dark, flash = np.zeros(SHAPE, np.float32), plane(3).copy()
    flash[0, 0], flash[1, 2] = 3e12, 3e15
    at = 7 * PERIOD + 12_345
    light = Light(
        (
            Piece(0, at, dark, dark),
            Piece(at, at + 1000, flash, flash),
            Piece(at + 1000, 20 * PERIOD, dark, dark),
        )
    )
    found = charges(Exposure(CLOCK, 1.0), light, 0, 20)
    due = [round(min(Fraction(float(v)) / 10**9, LARGEST) * ONE) for v in flash.ravel()]
    assert found[7] == pytest.approx(due, rel=1e-12, abs=1)
    assert not np.delete(found, 7, axis=0).any()
    # Pixels that are not clipped have the same bits as without such a neighbour.
    flash[0, 0] = flash[1, 2] = 0
    alone = charges(Exposure(CLOCK, 1.0), light, 0, 20)[7]
    kept = flash.ravel() > 0
    assert np.array_equal(found[7][kept], alone[kept])


@pytest.mark.parametrize("held", [False, True], ids=["usual", "beyond a cycle"])
@pytest.mark.parametrize("skew", [0.0, 0.3, 1.0])
def test_compiled_sums_are_numpys_to_the_last_bit(
    monkeypatch: pytest.MonkeyPatch, skew: float, held: bool
) -> None:
    import sensor.latched.exposure

    shape, random = (7, 9), np.random.default_rng(int(10 * skew))
    offsets = row_offsets(CLOCK, 7, skew, 0.0, (0, 7)) if skew else None
    pattern = DevicePattern(
        prnu=0.1, dark=5e4, dsnu=0.2, threshold_fpn=0.02,
        hot=0.05, hot_current=5e5, dead=0.05, device_seed=3,
    ).at(np.arange(63))  # fmt: skip
    knots = np.cumsum(random.integers(PERIOD // 9, 3 * PERIOD, 40)).tolist()
    made: list[Piece] = []
    for n, (a, b) in enumerate(itertools.pairwise([0, *knots])):
        first = level(shape, n, 2e8 if held and n % 7 == 3 else 700.0)
        last, box = first, None
        if n % 3 == 1:
            last = level(shape, 100 + n)
        elif n % 3 == 2 and made:  # goes on from the piece before but for a box
            first, box = made[-1].last, (1, 5, 2, 9)
            last = first.copy()
            last[1:5, 2:9] = level(shape, n)[1:5, 2:9]
        made.append(Piece(a, b, first, last, box))
    light, cycles = Light(tuple(made)), CLOCK.cycle_at(made[-1].stop) - 2

    def summed(large: int) -> np.ndarray:
        monkeypatch.setattr(sensor.latched.exposure, "_LARGE", large)
        return charges(Exposure(CLOCK, 3e5, pattern, offsets), light, 0, cycles)

    plain = summed(1 << 30)
    assert np.array_equal(summed(1), plain)
    assert (plain.max() > 1e6 * ONE) == held and len(np.unique(plain)) > 500
    monkeypatch.setattr(sensor.latched.exposure, "_BAND", 20)  # a few rows at a time
    assert np.array_equal(summed(1 << 30), plain)


def test_compiled_levels_refuse_bad_light(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sensor.latched.exposure._LARGE", 1)
    for bad in (-1.0, float("nan")):
        plane = np.full(SHAPE, bad, np.float32)
        with pytest.raises(ValueError, match="light must be 0 or more"):
            Exposure(CLOCK, 1.0).spans(Light((Piece(0, PERIOD, plane, plane),)), 0, 1)
