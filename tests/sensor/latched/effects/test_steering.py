"""Ticks of other lengths: the light of a tick is gathered between its own edges, in every tier."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim import PS, Block, Clock, Light, Piece
from cosim.compute.opencl import Device
from cosim.spikes.viform import unpack_planes
from sensor import CHIPS, CameraSetting, SpikeCamera
from sensor.device.chips import BOARD
from sensor.latched.effects import RESIDUAL
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE
from sensor.latched.sampling import ClockMoves, RowTiming
from tests.sensor.latched.piecewise import charges, level, light_between

CLOCK = Clock(40_000)
PERIOD = PS // 40_000
SHAPE = (12, 16)
EDGES = 140


def moves(seed: int) -> ClockMoves:
    """Ticks up to 1 % longer or shorter, by counts, and a slow drift of the clock."""
    random = np.random.default_rng(seed)
    counts = random.integers(-25, 26, EDGES) * BOARD.step
    counts += np.arange(EDGES) % 20 == 0
    return ClockMoves(np.concatenate([[0], np.cumsum(counts)]))


def camera(**sizes: object) -> CameraSetting:
    chip = replace(CHIPS["spiketwo"], height=SHAPE[0], width=SHAPE[1])
    return CameraSetting(chip, CLOCK, 2000.0, 3, effects=(RESIDUAL,), **sizes)


@pytest.mark.parametrize("seed", range(3))
def test_the_charge_of_a_tick_is_the_light_between_its_edges(seed: int) -> None:
    random = np.random.default_rng(seed)
    knots = [-PERIOD, *sorted(random.integers(0, 100 * PERIOD, 9)), 130 * PERIOD]
    light = light_between((4, 3), [int(k) for k in knots], True)
    steered = moves(seed)
    offsets = np.array([0, 7, 8_000_000, 24_000_000])
    exposure = Exposure(CLOCK, 3e5, None, offsets, steered.on(4))
    found = (charges(exposure, light, 0, 120) / ONE).cumsum(axis=0).reshape(120, 4, 3)
    for tick in (1, 17, 60, 119):
        for row in range(4):
            to = CLOCK.edge(tick) + int(offsets[row] + steered.at(tick, 1)[0])
            since = light.integral(int(offsets[row]), to)[row] * 3e5
            assert np.allclose(found[tick - 1, row], since, rtol=1e-6, atol=3e-2), (tick, row)


def test_a_longer_tick_has_the_charge_of_its_length() -> None:
    """Steady light: of a tick longer by s, the charge is larger by s."""
    plane = level((4, 3), 5)
    light = Light((Piece(-PERIOD, 150 * PERIOD, plane, plane),))
    found = charges(Exposure(CLOCK, 3e5, None, None, moves(1).on(4)), light, 0, 120) / ONE
    lengths = 1 + np.diff(moves(1).at(0, 121)) / PERIOD
    assert found[:, 0] / found[:, 0].mean() == pytest.approx(lengths / lengths.mean(), rel=1e-6)


@pytest.mark.parametrize("tier", ["fast", "reference"])
def test_tiers_agree_but_for_their_arithmetic(device: Device, tier: str) -> None:
    light = light_between(SHAPE, [-PERIOD, 7 * PERIOD + 3, 61 * PERIOD, 150 * PERIOD], True)
    made = camera(row_skew=0.9, clock_moves=moves(2))
    words = [
        SpikeCamera(made, device if t == "fast" else None, tier=t).step(light, Block(0, 128)).words
        for t in ("exact", tier)
    ]  # fmt: skip
    planes = [unpack_planes(w, 0, 128).astype(int) for w in words]
    assert planes[0].sum() > 2000
    # A rounded charge moves a spike by a tick at the most, and rarely: 3e-4 of them in `fast`.
    assert np.abs(planes[0].sum(axis=0) - planes[1].sum(axis=0)).max() <= 1
    assert (planes[0] != planes[1]).sum() < 0.003 * planes[0].sum()
    plain = SpikeCamera(made.changed(clock_moves=None), None).step(light, Block(0, 128)).words
    assert (plain != words[0]).any()


@pytest.mark.parametrize("tier", ["exact", "fast", "reference"])
def test_bits_do_not_depend_on_the_blocks_of_a_run(device: Device, tier: str) -> None:
    light = light_between(SHAPE, [-PERIOD, 7 * PERIOD + 3, 61 * PERIOD, 150 * PERIOD], True)
    made = camera(row_skew=0.9, clock_moves=moves(3))

    def words(block: int) -> np.ndarray:
        chip = SpikeCamera(made, device if tier == "fast" else None, tier=tier)
        parts = [chip.step(light, Block(n, block)).words for n in range(0, 128, block)]
        return np.concatenate(parts)

    assert (words(128) == words(32)).all()


@pytest.mark.parametrize("tier", ["fast", "reference"])
def test_timing_noise_of_pixels_adds_to_the_moves(device: Device, tier: str) -> None:
    """Steady light, in which the charge at a moved instant is known without an approximation."""
    plane = level(SHAPE, 5)
    light = Light((Piece(-PERIOD, 150 * PERIOD, plane, plane),))
    noise = RowTiming(0.1, 0.01, 0.5, 6.0)
    made = camera(row_skew=0.9, clock_moves=moves(4), row_timing=noise)
    planes = []
    for each in ("exact", tier):
        chip = SpikeCamera(made, device if each == "fast" else None, tier=each)
        planes.append(unpack_planes(chip.step(light, Block(0, 128)).words, 0, 128).astype(int))
    assert (planes[0] != planes[1]).sum() < 0.003 * planes[0].sum()
    for other in (made.changed(clock_moves=None), made.changed(row_timing=None)):
        plain = unpack_planes(SpikeCamera(other, None).step(light, Block(0, 128)).words, 0, 128)
        assert (plain != planes[0]).any()


def test_moves_hold_before_the_first_edge_and_after_the_last() -> None:
    steered = ClockMoves(np.array([0, 5, -3]))
    assert steered.at(-2, 7).tolist() == [0, 0, 0, 5, -3, -3, -3] and steered.most == 5
    with pytest.raises(ValueError, match="begin with 0"):
        ClockMoves(np.array([1, 2]))


def test_a_tick_is_shortened_by_what_the_readout_leaves_blank() -> None:
    """1000 rows over the whole tick leave a row's time, 25 ns: two counts of 10 ns."""
    assert BOARD.step == 10_000
    assert BOARD.most(CLOCK) == 25
    assert BOARD.least(CLOCK, 1.0, 1000) == 2
    assert BOARD.least(CLOCK, 0.5, 1000) == 25
    assert BOARD.least(CLOCK, 0.995, 1000) == 14
