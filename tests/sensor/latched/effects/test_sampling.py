"""Row-by-row sampling and comparator delay: each row gets the light at its sampling instant."""

from __future__ import annotations

import itertools
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import PS, Block, Clock, Light, Piece, Summary
from cosim.compute.opencl import Device
from sensor import CHIPS, CameraSetting, SpikeCamera
from sensor.latched.effects import RESIDUAL
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE
from sensor.latched.sampling import row_offsets
from tests.sensor.latched.piecewise import charges, level, light_between

CLOCK = Clock(40_000)
PERIOD = PS // 40_000
SHAPE = (5, 4)
plane = partial(level, SHAPE)
pieces = partial(light_between, SHAPE)


@settings(max_examples=60, deadline=None)
@given(
    inner=st.lists(st.integers(1, 21 * PERIOD - 1), max_size=8, unique=True),
    jumps=st.booleans(),
    skew=st.floats(0, 1),
    delay=st.floats(0, 25e-6),
)
def test_each_row_integrates_its_own_window(
    inner: list[int], jumps: bool, skew: float, delay: float
) -> None:
    light = pieces([0, *sorted(inner), 21 * PERIOD], jumps)
    offsets = row_offsets(CLOCK, SHAPE[0], skew, delay, (0, SHAPE[0]))
    found = charges(Exposure(CLOCK, 2.86e5, None, offsets), light, 1, 19) / ONE
    found = found.reshape(19, *SHAPE)
    for cycle, (row, offset) in itertools.product(range(19), enumerate(offsets.tolist())):
        a, b = CLOCK.edge(cycle + 1) + offset, CLOCK.edge(cycle + 2) + offset
        exact = light.integral(a, b)[row] * 2.86e5
        assert np.allclose(found[cycle, row], exact, rtol=1e-9, atol=40 / ONE)


@settings(max_examples=30, deadline=None)
@given(
    inner=st.lists(st.integers(1, 40 * PERIOD - 1), max_size=6, unique=True),
    cuts=st.lists(st.integers(1, 39), max_size=5, unique=True),
    delay=st.floats(0, 25e-6),
)
def test_charges_do_not_depend_on_how_the_run_is_split(
    inner: list[int], cuts: list[int], delay: float
) -> None:
    light = pieces([0, *sorted(inner), 41 * PERIOD], True)
    offsets = row_offsets(CLOCK, SHAPE[0], 1.0, delay, (0, SHAPE[0]))
    whole = charges(Exposure(CLOCK, 1e5, None, offsets), light, 0, 40)
    edges = [0, *sorted(cuts), 40]
    parts = [
        charges(Exposure(CLOCK, 1e5, None, offsets), light, a, b - a)
        for a, b in itertools.pairwise(edges)
    ]
    assert np.array_equal(np.concatenate(parts), whole)


def test_the_changed_box_changes_no_bit() -> None:
    planes, boxes = [plane(1)], [(0, 2, 1, 4), (1, 3, 0, 2), (3, 5, 0, 1)]
    for n, (y0, y1, x0, x1) in enumerate(boxes):
        moved = planes[-1].copy()
        moved[y0:y1, x0:x1] = plane(10 + n)[y0:y1, x0:x1]
        planes.append(moved)
    offsets = row_offsets(CLOCK, SHAPE[0], 1.0, 10e-6, (0, SHAPE[0]))

    def light(hint: bool) -> Light:
        ends = [PERIOD * n + 1234 * n for n in (0, 1, 2, 9)]  # the first is shorter than two cycles
        each = zip(itertools.pairwise(ends), itertools.pairwise(planes), boxes, strict=True)
        return Light(tuple(Piece(*t, *p, box if hint else None) for t, p, box in each))

    hinted = charges(Exposure(CLOCK, 3e4, None, offsets), light(True), 0, 8)
    assert np.array_equal(hinted, charges(Exposure(CLOCK, 3e4, None, offsets), light(False), 0, 8))
    assert (hinted != hinted[0]).any()


@pytest.mark.parametrize(("skew", "delay"), [(1.0, 0.0), (1.0, 3e-6), (0.5, 24e-6), (0.0, 25e-6)])
def test_a_light_step_lands_in_the_right_rows_right_cycle(
    device: Device, skew: float, delay: float
) -> None:
    # From dark to `spikes` thresholds a cycle at instant `at`: each row reaches a threshold at
    # at + T / spikes, and fires at its first sampling at or after this instant.
    chip, at = CHIPS["spikeone"], 7 * PERIOD + PERIOD // 3
    setting = CameraSetting(
        chip, CLOCK, 300.0, 1, effects=(RESIDUAL,), row_skew=skew, comparator_delay=delay
    )
    spikes = np.linspace(0.07, 3.3, chip.width)
    lux = spikes / setting.rate(1.0)
    bright = np.broadcast_to(lux, (chip.height, chip.width)).astype(np.float32)
    light = Light((Piece(0, at, 0 * bright, 0 * bright), Piece(at, 10**12, bright, bright)))
    for camera in (SpikeCamera(setting, device), SpikeCamera(setting, None)):
        planes = camera.step(light, Block(0, 64)).planes()
        first = np.where(planes.any(axis=0), planes.argmax(axis=0), -1)
        row = np.arange(chip.height)[:, None]
        # Row r of cycle k is sampled at k + 1 + skew r/H - delay, in cycles.
        exact = at / PERIOD + 1 / spikes - 1 - skew * row / chip.height + delay / 25e-6
        clear = np.abs(exact - np.rint(exact)) > 1e-5  # picoseconds and float32 of light
        assert clear.mean() > 0.99
        assert np.array_equal(first[clear], np.ceil(exact).astype(int)[clear])


def test_a_row_alone_is_the_row_of_the_whole(device: Device) -> None:
    setting = CameraSetting(CHIPS["spikeone"], CLOCK, 300.0, 4, row_skew=1.0, comparator_delay=2e-6)
    levels = [(np.random.default_rng(n).random((250, 400)) * 60).astype(np.float32) for n in (2, 3)]

    def film(rows: slice) -> Light:
        return Light((Piece(0, 40 * PERIOD, *(level[rows] for level in levels)),))

    whole = SpikeCamera(setting, device).step(film(slice(None)), Block(1, 38))
    part = SpikeCamera(setting, None, rows=(101, 130)).step(film(slice(101, 130)), Block(1, 38))
    assert np.array_equal(part.words, whole.words[:, 101:130])


def test_offsets_and_limits() -> None:
    assert row_offsets(CLOCK, 4, 1.0, 0.0, (0, 4)).tolist() == [n * PERIOD // 4 for n in range(4)]
    assert row_offsets(CLOCK, 4, 1.0, 1e-6, (2, 4)).tolist() == [11_500_000, 17_750_000]
    for skew, delay in ((-0.1, 0), (1.1, 0), (0, -1e-9), (0, 26e-6)):
        with pytest.raises(ValueError, match="must be 0 to"):
            row_offsets(CLOCK, 4, skew, delay, (0, 4))


def test_the_bound_holds_where_the_light_changes_most() -> None:
    # A window of 10 cycles at whose end the light jumps from `dark` to `bright`: shifted by half a
    # cycle it gains half a cycle of the difference.
    dark, bright, window = 10.0, 400.0, 10
    for key, size in (("row_skew", 0.5), ("comparator_delay", 0.5 * 25e-6)):
        setting = CameraSetting(CHIPS["spikeone"], CLOCK, 1000.0, 1, effects=(), **{key: size})
        (effect,) = setting.acting_effects
        bound = effect.bound(Summary(dark, bright, 1000.0, window, 100))
        gained = (bright - dark) * 0.5 / (dark * window)
        assert gained <= bound.value <= gained * (1 + 1e-12) and bound.kind == "proof"
        # With noisy thresholds, a shifted window has other draws: a larger bound, an estimate.
        noisy = effect.bound(Summary(dark, bright, 1000.0, window, 100, spread=0.03))
        assert noisy.kind == "estimate" and noisy.value > bound.value
        assert effect.bound(Summary(0.0, 0.0, 1000.0, window, 100)).value == 0
