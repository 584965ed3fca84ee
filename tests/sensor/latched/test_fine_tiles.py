"""Tiles that a better tier simulates have its bits, and all others those of their own.

Patches have the same bits as on the whole chip, in every tier.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim import PS, Block, Clock, Light, Piece
from cosim.compute.opencl import Device
from cosim.light.light import PlaneMap
from cosim.plan.tiles import TILE, PatchPlane, TileGrid
from sensor import CHIPS, CameraSetting, SpikeCamera
from sensor.device.pattern import DevicePattern
from sensor.latched.fine_tiles import FineTiles, MixedPatches, PatchCamera
from sensor.latched.sampling import RowTiming
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
    # A pixel that timing noise makes late has more than a threshold.
    assert (share <= 1.2).all() and share.std() > 0.1


def test_patches_of_different_sizes_do_not_stack() -> None:
    with pytest.raises(ValueError, match="must be of one size"):
        PatchPlane(TileGrid(*SHAPE), [0, 4])


GRID = TileGrid(*SHAPE)
BLOCKS = (Block(0, 37), Block(37, 60))


def tiles_of(*numbers: int) -> np.ndarray:
    """(tiles,) bool, true for these."""
    tiles = np.zeros(len(GRID), bool)
    tiles[list(numbers)] = True
    return tiles


def words_of(chip: SpikeCamera) -> np.ndarray:
    """Words of both blocks, (words, pixels)."""
    shown = light(camera())
    return np.concatenate([chip.step(shown, b).words.reshape(-1, SHAPE[0] * SHAPE[1])
                           for b in BLOCKS])  # fmt: skip


@pytest.mark.parametrize("tier", ["exact", "fast"])
def test_each_tile_has_the_bits_of_its_tier(device: Device, tier) -> None:
    setting = camera()
    # Two tiles of the reference are at the edges, and smaller.
    fine = {"reference": tiles_of(1, 4, 19), "exact": tiles_of(0, 7)}
    used = device if tier == "fast" else None
    mixed = words_of(
        SpikeCamera(setting, used, tier=tier, fine=FineTiles(setting, GRID, fine, used))
    )
    words = {
        t: words_of(SpikeCamera(setting, device if t == "fast" else None, tier=t))
        for t in ("reference", "exact", tier)
    }
    inside = {
        t: np.repeat(GRID.groups(tiles), TILE, axis=1)[:, : SHAPE[1]].ravel()
        for t, tiles in fine.items()
    }
    inside[tier] = ~np.any(list(inside.values()), axis=0) | inside.get(tier, False)
    for t, pixels in inside.items():
        assert (mixed[:, pixels] == words[t][:, pixels]).all()
    pixels = inside["reference"]  # dead time at changing light differs
    assert (words["reference"][:, pixels] != words[tier][:, pixels]).any()


def test_a_chip_of_fine_tiles_is_the_reference() -> None:
    setting = camera()
    fine = FineTiles(setting, GRID, {"reference": np.ones(len(GRID), bool)})
    assert fine.everywhere
    both = (
        words_of(SpikeCamera(setting, None, fine=fine)),
        words_of(SpikeCamera(setting, None, tier="reference")),
    )
    assert (both[0] == both[1]).all()


def test_a_state_continues(device: Device) -> None:
    setting, shown = camera(), light(camera())
    one, two = (
        SpikeCamera(
            setting,
            device,
            tier="fast",
            fine=FineTiles(
                setting, GRID, {"reference": tiles_of(0, 3), "exact": tiles_of(5)}, device
            ),
        )
        for _ in "ab"
    )
    one.step(shown, BLOCKS[0])
    two.restore(one.state())
    assert (one.step(shown, BLOCKS[1]).words == two.step(shown, BLOCKS[1]).words).all()


def test_mixed_patches_are_those_of_the_chip() -> None:
    setting, shown = camera(), light(camera())
    plane = PatchPlane(GRID, [0, 6, 12])
    fine = np.array([False, True, False])
    made = [
        MixedPatches(PatchCamera(setting, plane, "exact"), setting, plane, {"reference": fine})
        for _ in "ab"
    ]
    parts = [PatchCamera(setting, plane, tier) for tier in ("exact", "reference")]
    cut = PlaneMap(plane.cut, None)(shown)
    inside = np.repeat(fine, 256)
    for n, block in enumerate(BLOCKS):
        words = made[n].step(cut, block.start, block.cycles)
        exact, full = (part.step(cut, block.start, block.cycles) for part in parts)
        assert (words == np.where(inside, full, exact)).all()
        assert (made[n].bits == np.where(inside, parts[1].bits, parts[0].bits)).all()
        assert (made[n].phase() == np.where(inside, parts[1].phase(), parts[0].phase())).all()
        if n == 0:
            made[1].restore(made[0].state())
