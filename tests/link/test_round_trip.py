"""Without noise, blur or motion every file arrives bit for bit, in every mode and reset rule."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from cosim import PS, Block, Clock, Viform
from cosim.light.radiometry import photons_per_lux
from display import SpikePanel
from link.air import Aim, Air, AirSetting, Optics, Scene, f_number_for
from link.mode import CELLS, LINE_CODES, TICKS, Mode
from link.receiving import Received, Receiver
from link.sending import FileTransmission
from sensor import CHIPS, EFFECTS, CameraSetting, SpikeCamera
from sensor.latched.pixel.model import Reset

CLOCK = Clock(40_000)
SIDE, PANEL = 144, 128
DISTANCE = 2.0
FOCAL_LENGTH = DISTANCE * 0.02 / 1.02
"""A panel pixel of 500 um is a camera pixel of 10 um."""
RESETS: tuple[tuple[Reset, float], ...] = (("hard", 1.4), ("residual", 1.4), ("subtract", 1.0005))
"""With the light of a tick in thresholds: what subtraction leaves over must not become a spike."""
GRID = [
    (cell, ticks, LINE_CODES[(i + j) % len(LINE_CODES)], *RESETS[(i + 2 * j) % 3])
    for (i, cell), (j, ticks) in product(enumerate(CELLS), enumerate(TICKS))
]
"""Every cell size with every length of symbol; every line code with every reset rule."""
FEW = [GRID[2]]
DATA = np.random.Generator(np.random.Philox(key=6)).bytes(200)


def crossed(
    cell: int, ticks: int, line: str, reset: Reset, level: float, data: bytes = DATA
) -> Received:
    """What a receiver makes of `data` sent in this mode."""
    sent = FileTransmission(Mode(PANEL, PANEL, cell, ticks, line, 16), data, "a.bin", overhead=0.0)
    chip = replace(CHIPS["spiketwo"], width=SIDE, height=SIDE)
    kept = (EFFECTS["residual carried"],) if reset == "residual" else ()
    camera = CameraSetting(chip, CLOCK, 1000.0, 1, effects=kept, reset=reset)
    optics = Optics(
        PANEL, PANEL, 500e-6, 1000.0, 0.0, FOCAL_LENGTH, 2.0, 0.9, None, 0.0, chip.pitch * 1e-6
    )
    per_lux = chip.electrons_per_lux(photons_per_lux(555.0))
    stop = f_number_for(level, optics, DISTANCE, 1000.0, per_lux, CLOCK)
    panel = SpikePanel((PANEL, PANEL), CLOCK, 1.0, drive="impulse", row_scan=0.0)
    scene = Scene(panel, replace(optics, f_number=stop), Aim(), AirSetting(DISTANCE))
    air = Air(
        sent, scene, camera, first_light=12 * PS // 40_000, planes=sent.planes, effects=()
    )  # fmt: skip
    eye, receiver = SpikeCamera(camera, None, row_delay=air.row_delay), Receiver((SIDE, SIDE))
    for first in range(0, sent.planes + 32, 64):
        block = Block(first, 64)
        words = eye.step(air.step(None, block), block)
        assert isinstance(words, Viform)
        receiver.step(words, block)
    return receiver.finish()


def test_the_grid_holds_every_pair() -> None:
    assert {case[2:4] for case in GRID} == {(a, b[0]) for a, b in product(LINE_CODES, RESETS)}
    assert {case[:2] for case in GRID} == set(product(CELLS, TICKS))


@pytest.mark.parametrize("case", FEW, ids=str)
def test_a_noiseless_round_trip_is_bit_exact(case: tuple[int, int, str, Reset, float]) -> None:
    got = crossed(*case)
    assert got.verdict.whole, got.verdict
    assert got.delivered == (DATA, "a.bin")


@pytest.mark.slow
@pytest.mark.parametrize("case", GRID, ids=str)
def test_every_noiseless_round_trip_is_bit_exact(
    case: tuple[int, int, str, Reset, float],
) -> None:
    got = crossed(*case)
    assert got.verdict.whole, got.verdict
    assert got.delivered == (DATA, "a.bin")
