"""Tiles that a better tier simulates have its bits, and all others those of their own."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Block
from cosim.compute.opencl import Device
from cosim.light.light import PlaneMap
from cosim.plan.tiles import TILE, PatchPlane, TileGrid
from sensor import SpikeCamera
from sensor.latched.fine_tiles import FineTiles, MixedPatches
from sensor.latched.patches import PatchCamera
from tests.sensor.latched.test_patches import SHAPE, camera, light

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
