"""All drives emit one packet for each spike, at any steady rate, with noise or without."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.spikes.viform import pack_planes
from display import SpikePanel
from display.drives import DRIVES
from display.probes.waveform import panel_light

RATES = np.array([0.01, 0.02, 0.05, 0.1, 0.17, 0.3, 0.37, 0.45, 0.5, 0.6, 2 / 3, 0.72, 0.9, 1.0])
PLANES = 400_000


@pytest.mark.parametrize("spread", [0.0, 0.03, 0.1])
@pytest.mark.parametrize("drive", DRIVES)
def test_the_total_light_is_one_packet_per_spike(drive: str, spread: float) -> None:
    rng = np.random.default_rng(5)
    spikes = np.zeros((PLANES, 1, len(RATES)), np.bool_)
    for n, rate in enumerate(RATES):
        count = round(rate * PLANES)
        thresholds = rng.gamma(1 / spread**2, spread**2, count) if spread else np.ones(count)
        latched = np.ceil(np.cumsum(thresholds) / rate - rng.random()).astype(np.int64)
        spikes[latched[latched < PLANES], 0, n] = True
    panel = SpikePanel((1, len(RATES)), Clock(40_000), 0.6, drive)
    light = panel_light(Viform(pack_planes(spikes), PLANES, panel.clock), panel, drive)
    total = light.sum(axis=0) / spikes.sum(axis=(0, 1))
    assert np.abs(total - 1).max() < 1e-3
    assert light.max() <= 1 and light.min() >= 0


def test_a_change_of_light_is_balanced_within_limits() -> None:
    """From 0.5 to 0.005 spikes a cycle, a hold emits 100 packets for one; no pixel stays dark."""
    at = np.concatenate([np.arange(0, 400, 2), np.arange(598, 4000, 200)])
    spikes = np.zeros((4000, 1, 1), np.bool_)
    spikes[at] = True
    panel = SpikePanel((1, 1), Clock(40_000), 0.6, "hold")
    light = panel_light(Viform(pack_planes(spikes), 4000, panel.clock), panel, "hold")[:, 0]
    assert light[598:798] == pytest.approx(0.25 / 200)  # the lower limit, -3
    assert light[-1] == pytest.approx(1 / 200, rel=0.03)
