"""Noise is not known where pixels are too alike and too quiet to show it."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.spikes.viform import Viform
from sensor.calibrate.calibration import Calibration, Recording, calibrate
from sensor.calibrate.page import preset_text
from tests.sensor.calibrate.simulated import CLOCK


def quiet(rate: float, prnu: float, cycles: int, seed: int) -> Calibration:
    """Of a flat by pixels without noise, 48 x 64."""
    rng = np.random.default_rng(seed)
    light = rate * (1 + prnu * rng.standard_normal((48, 64)))
    at = np.floor(rng.random((48, 64)) + light * np.arange(cycles + 1)[:, None, None])
    planes = np.diff(at, axis=0).astype(np.uint8)
    return calibrate(Recording("flat", Viform.from_planes(planes, CLOCK)))


@pytest.mark.parametrize(
    ("rate", "prnu", "cycles"),
    [(0.08, 0.06, 128), (0.15, 0.03, 128), (0.4, 0.008, 128), (0.3, 0.003, 400), (0.6, 0.0, 400)],
)
def test_rounding_that_is_alike_is_no_noise(rate: float, prnu: float, cycles: int) -> None:
    result = quiet(rate, prnu, cycles, int(1e4 * rate) + cycles)
    found = result.parameters
    for name in ("threshold", "threshold_noise", "latch_noise", "row_jitter"):
        assert not found[name].known and found[name].value is None, name
        assert found[name].remedy
    assert not found["interval_noise"].known
    assert found["interval_noise"].holds(0.0) and found["latch_noise"].holds(0.0)
    assert not any(line.startswith(("latch", "intervals")) for line in result.does_not_fit)
    text = preset_text(result)  # with what the recording shows
    assert text is not None and "row_jitter =" not in text
    assert "interval_noise: not known" in text


@pytest.mark.parametrize("rate", [0.15, 0.31, 0.45])
def test_of_pixels_that_differ_it_is_known_to_be_none(rate: float) -> None:
    found = quiet(rate, 0.03, 2000, 1).parameters
    for name in ("interval_noise", "latch_noise"):
        assert found[name].known and found[name].holds(0.0), name
        high = found[name].ci[1]
        assert high is not None and high < 0.015
    assert found["row_jitter"].value is None
