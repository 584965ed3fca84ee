"""One band of rows of a chip: what a worker does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import choose_device
from cosim.compute.pocl_files import keep_sums
from cosim.spikes.viform import WORD, Words, words_for
from cosim.stage import BLOCK, blocks
from scenarios.assemble.camera.bands.strip import Strip
from scenarios.assemble.camera.setup import CameraSetup
from sensor import CameraSetting, SpikeCamera
from sensor.latched.tiers import Tier

HALO = 1
"""Rows around a band that are simulated as well where pixels share light (cross-talk)."""


@dataclass(frozen=True, eq=False)
class Band:
    """Rows of a planned camera.

    Attributes:
        rows: first row, and the one after the last.
        setup: the camera and its scene, without its device.
        setting: the planned camera.
        tier: its arithmetic.
        flags: flags of the fast tier for the rows with their halo, (rows, groups) uint8; None in
            another tier.
        device: device as for `choose_device`.
    """

    rows: tuple[int, int]
    setup: CameraSetup
    setting: CameraSetting
    tier: Tier
    flags: npt.NDArray[np.uint8] | None
    device: str | None

    @property
    def simulated(self) -> tuple[int, int]:
        """The rows with their halo."""
        if self.setting.light_map is None:
            return self.rows
        return max(self.rows[0] - HALO, 0), min(self.rows[1] + HALO, self.setup.shape[0])


def expose_band(band: Band) -> Words:
    """The words of the band over the whole run, (words, rows, W) uint32.

    The bits are those of the whole chip: a pixel keeps its number, and with it its noise.
    """
    setup, (low, high) = band.setup, band.simulated
    camera = SpikeCamera(
        band.setting, choose_device(band.device), (low, high), band.tier, band.flags
    )
    clock, reach = setup.setting.clock, setup.setting.reach
    strip = Strip(setup.source(), setup.lens.relay(setup.setting.chip.pitch), (low, high), reach)
    first, stop = (row - low for row in band.rows)
    words = np.zeros((words_for(setup.cycles), stop - first, setup.shape[1]), np.uint32)
    for block in blocks(setup.cycles, BLOCK):
        light = strip.step(block, clock.edge(max(block.start - reach[0], 0)))
        part = camera.step(light, block).words[:, first:stop]
        words[block.start // WORD :][: len(part)] = part
    keep_sums()  # a worker is killed when its bands are done
    return words
