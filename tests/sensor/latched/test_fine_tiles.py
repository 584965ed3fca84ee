"""Tiles that the reference simulates have its bits, and all others those of their tier."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Block
from cosim.compute.opencl import Device
from cosim.light.light import PlaneMap
from cosim.plan.patches import PatchPlane
from cosim.plan.tiles import TileGrid
from sensor import SpikeCamera
from sensor.latched.fine_tiles import FineTiles, MixedPatches
from sensor.latched.patches import PatchCamera
from tests.sensor.latched.test_patches import SHAPE, camera, light

GRID = TileGrid(*SHAPE)
BLOCKS = (Block(0, 37), Block(37, 60))


def words_of(chip: SpikeCamera) -> np.ndarray:
    """Words of both blocks, (words, pixels)."""
    shown = light(camera())
    return np.concatenate([chip.step(shown, b).words.reshape(-1, SHAPE[0] * SHAPE[1])
                           for b in BLOCKS])  # fmt: skip


@pytest.mark.parametrize("tier", ["exact", "fast"])
def test_each_tile_has_the_bits_of_its_tier(device: Device, tier) -> None:
    setting, tiles = camera(), np.array([1, 4, 19])  # two of them at the edges, which are smaller
    used = device if tier == "fast" else None
    mixed = words_of(SpikeCamera(setting, used, tier=tier, fine=FineTiles(setting, GRID, tiles)))
    full, plain = (
        words_of(SpikeCamera(setting, used if t == tier else None, tier=t))
        for t in ("reference", tier)
    )
    inside = np.zeros(SHAPE, bool)
    for tile in tiles:
        y0, y1, x0, x1 = GRID.box(tile)
        inside[y0:y1, x0:x1] = True
    inside = inside.ravel()
    assert (mixed[:, inside] == full[:, inside]).all()
    assert (mixed[:, ~inside] == plain[:, ~inside]).all()
    assert (full[:, inside] != plain[:, inside]).any()  # dead time at changing light differs


def test_a_chip_of_fine_tiles_is_the_reference() -> None:
    setting = camera()
    fine = FineTiles(setting, GRID, np.arange(len(GRID)))
    assert fine.everywhere
    both = (
        words_of(SpikeCamera(setting, None, fine=fine)),
        words_of(SpikeCamera(setting, None, tier="reference")),
    )
    assert (both[0] == both[1]).all()


def test_a_state_continues() -> None:
    setting, shown = camera(), light(camera())
    one, two = (
        SpikeCamera(setting, None, fine=FineTiles(setting, GRID, np.array([0, 3]))) for _ in "ab"
    )
    one.step(shown, BLOCKS[0])
    two.restore(one.state())
    assert (one.step(shown, BLOCKS[1]).words == two.step(shown, BLOCKS[1]).words).all()


def test_mixed_patches_are_those_of_the_chip() -> None:
    setting, shown = camera(), light(camera())
    plane = PatchPlane(GRID, [0, 6, 12])
    fine = np.array([False, True, False])
    made = [MixedPatches(PatchCamera(setting, plane, "exact"), setting, plane, fine) for _ in "ab"]
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
