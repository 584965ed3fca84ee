"""The whole chain: a sender's panel, the air, the camera, the receiver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim import PS, Block, Clock, Viform
from cosim.light.radiometry import photons_per_lux
from display import SpikePanel
from link.air import Aim, Air, AirSetting, Optics, Scene, f_number_for
from link.mode import Mode
from link.receiving import Received, Receiver
from link.sending import FileTransmission, Transmission
from sensor import CHIPS, CameraSetting, SpikeCamera
from tests.link.receiving.toy import corner_error

CLOCK = Clock(40_000)
SIDE, FIRST = 300, 12.4
MODE = Mode(256, 256, 2, 2, "8b10b", 32)
DATA = np.random.Generator(np.random.Philox(key=6)).bytes(6000)


def through(row_scan: float, ppm: float) -> tuple[Received, Air, Transmission]:
    """6000 bytes over 2 m, row skew of a tick, vibration, ambient light."""
    sent = FileTransmission(MODE, DATA, "a.bin")
    clock = Clock(40_000 * (1_000_000 + round(ppm)), 1_000_000)
    panel = SpikePanel((256, 256), clock, 1.0, drive="impulse", row_scan=row_scan)
    chip = replace(CHIPS["spiketwo"], width=SIDE, height=SIDE)
    camera = CameraSetting(chip, CLOCK, 1000.0, 1, reset="hard", row_skew=1.0, threshold_noise=5.8)
    optics = Optics(256, 256, 500e-6, 1000.0, 0.04, 39e-3, 2.0, 0.9, None, 0.3, chip.pitch * 1e-6)
    per_lux = chip.electrons_per_lux(photons_per_lux(555.0))
    optics = replace(optics, f_number=f_number_for(1.4, optics, 2.0, 1000.0, per_lux, CLOCK))
    aim = Aim((3.3, -2.6), 0.3, (0.5, -0.4), vibration=0.05)
    stage = Air(
        sent, Scene(panel, optics, aim, AirSetting(2.0, ambient=500.0)), camera,
        first_light=round(FIRST * PS / 40_000), planes=sent.planes,
    )  # fmt: skip
    eye = SpikeCamera(camera, None, row_delay=stage.row_delay)
    receiver = Receiver((SIDE, SIDE))
    for first in range(0, sent.planes + 32, 64):
        block = Block(first, 64)
        given = eye.step(stage.step(None, block), block)
        assert isinstance(given, Viform)
        receiver.step(given, block)
    return receiver.finish(), stage, sent


@pytest.mark.parametrize(("row_scan", "ppm"), [(1.0, 20.0), (0.0, -500.0)], ids=["step", "apart"])
def test_a_file_crosses_the_whole_chain(row_scan: float, ppm: float) -> None:
    got, stage, sent = through(row_scan, ppm)
    assert got.verdict.whole, got.verdict
    assert got.delivered == (DATA, "a.bin")
    assert (
        corner_error(got.registration.homography, stage.truth.homography, MODE) < 0.15
    )  # vibration is in it
    # the panel's rows cover 262 of the camera's 300, in step or all at once; the camera's 300
    true_slope = row_scan * 300 / 262 - 1
    assert abs(got.timing.slope - true_slope) < 0.1
    assert abs(got.on - 1.4) < 0.1
    wrong = got.decided(48, 10) != sent.bits(48, 10)
    assert wrong.mean() < 0.01
