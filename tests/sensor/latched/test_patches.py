"""Patches have the same bits as on the whole chip, in every tier."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim import PS, Block, Clock, Light, Piece
from cosim.compute.opencl import Device
from cosim.light.light import PlaneMap
from cosim.plan.tiles import PatchPlane, TileGrid
from sensor import CHIPS, CameraSetting, SpikeCamera
from sensor.device.pattern import DevicePattern
from sensor.latched.patches import PatchCamera
from sensor.latched.row_timing import RowTiming
from sensor.latched.tiers import Tier

PERIOD = PS // 40_000
SHAPE = (50, 70)
"""The tiles at the right and the bottom are smaller."""


def camera(**more: object) -> CameraSetting:
    """A camera with all effects."""
    chip = replace(CHIPS["spikeone"], height=SHAPE[0], width=SHAPE[1])
    pattern = DevicePattern(prnu=0.05, dark=1e4, dsnu=0.3, threshold_fpn=0.02, hot=0.01,
                            hot_current=1e6, dead=0.01, device_seed=4)  # fmt: skip
    return CameraSetting(
        chip, Clock.from_hz(40e3), 300.0, 5, pattern=pattern, threshold_noise=3.0, dead_time=2e-6,
        row_skew=0.5, comparator_delay=1e-6, crosstalk=0.05,
        row_timing=RowTiming(0.08, 0.01, 0.4, 9.0), drift=1e-3,
    )  # fmt: skip


def light(setting: CameraSetting) -> Light:
    """A constant texture that changes linearly to another one from the middle of a cycle on."""
    rng = np.random.default_rng(3)
    white = 1 / setting.rate(1.0)
    first, last = (
        (white * rng.uniform(0.02, 0.9, SHAPE)).astype(np.float32) for _ in range(2)
    )  # fmt: skip
    turn = 40 * PERIOD + 777
    return Light((
        Piece(-PERIOD, turn, first, first), Piece(turn, 70 * PERIOD, first, last),
        Piece(70 * PERIOD, 200 * PERIOD, last, last),
    ))  # fmt: skip


@pytest.mark.parametrize("tier", ["reference", "exact", "fast"])
@pytest.mark.parametrize("tiles", [[0, 7, 12], [4, 9]])
def test_patches_have_the_bits_of_the_whole_chip(device: Device, tier: Tier, tiles) -> None:
    setting = camera()
    used = device if tier == "fast" else None
    shown = light(setting)
    whole = SpikeCamera(setting, used, tier=tier)
    plane = PatchPlane(TileGrid(*SHAPE), tiles)
    patches = PatchCamera(setting, plane, tier, used)
    cut = PlaneMap(plane.cut, None)
    fired = 0
    for start in (0, 64):
        words = whole.step(shown, Block(start, 64)).words
        found = plane.split(patches.step(cut(shown), start, 64))
        for n, tile in enumerate(tiles):
            y0, y1, x0, x1 = TileGrid(*SHAPE).box(tile)
            expected = words[:, y0:y1, x0:x1].reshape(len(words), -1)
            np.testing.assert_array_equal(found[:, n], expected)
        fired += int(np.bitwise_count(found).sum())
    assert fired == patches.bits.sum() > 10_000


@pytest.mark.parametrize("tier", ["reference", "exact", "fast"])
def test_a_phase_counts_bits_and_goes_on_from_its_state(device: Device, tier: Tier) -> None:
    setting = camera().without(["hot and dead pixels"])
    plane = PatchPlane(TileGrid(*SHAPE), [5])
    used = device if tier == "fast" else None
    shown = PlaneMap(plane.cut, None)(light(setting))
    one, two = (PatchCamera(setting, plane, tier, used) for _ in range(2))
    one.step(shown, 0, 50)
    two.restore(one.state())
    np.testing.assert_array_equal(one.phase(), two.phase())
    np.testing.assert_array_equal(one.step(shown, 50, 60), two.step(shown, 50, 60))
    np.testing.assert_array_equal(one.phase(), two.phase())
    share = one.phase() - one.bits
    assert (share <= 1).all() and share.std() > 0.1


def test_patches_of_different_sizes_do_not_stack() -> None:
    with pytest.raises(ValueError, match="must be of one size"):
        PatchPlane(TileGrid(*SHAPE), [0, 4])
