"""What pixels have in common is found, is written, and is in the films of what was written."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cosim.spikes.viform import Viform
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import load
from sensor.calibrate.calibration import Calibration, Recording, calibrate
from sensor.calibrate.common import (
    drift_parameter,
    duplicated_rows,
    measure_drift,
    measure_lines,
)
from sensor.calibrate.page import preset_text
from sensor.calibrate.trains import read_trains
from sensor.device.pattern import DevicePattern
from sensor.latched.sampling import RowTiming
from tests.sensor.calibrate.simulated import CLOCK, Truth, film

SHAPE, CYCLES = (44, 60), 992
PATTERN = DevicePattern(
    prnu=0.025, rows=0.006, along_row=0.35, along_column=0.25, width=SHAPE[1], device_seed=4
)
TRUTH = Truth(20_000.0, 100.0, PATTERN, 0.0, SHAPE)


@cache
def recorded() -> Viform:
    """A chip as one that was recorded: rows 2 and 3 show 0 and 1, a band has timing noise."""
    band = RowTiming(0.084, 0.0, 0.5, 10.0)
    stream = TRUTH.record(0.3, CYCLES, 5, drift=2e-3, row_timing=band)
    words = np.array(stream.words)
    words[:, [2, 3]] = words[:, [0, 1]]
    return Viform(words, CYCLES, CLOCK)


@cache
def calibrated() -> Calibration:
    return calibrate(Recording("chip", recorded()))


def test_what_pixels_have_in_common_is_known() -> None:
    found = calibrated().parameters
    assert calibrated().roles == {"chip": "flat"}
    assert found["row_jitter"].holds(0.084)
    band, width = found["row_band"].value, found["row_band_width"].value
    assert isinstance(band, float) and isinstance(width, float)
    assert abs(band - 0.5) < 0.04 and 7 < width < 14
    assert found["drift"].holds(2e-3) and found["drift"].ci[0]
    assert found["row_fpn"].holds(0.006) and found["row_fpn"].value
    assert found["column_fpn"].value == 0
    assert found["neighbours_in_row"].holds(0.35)
    assert found["neighbours_in_column"].holds(0.25)
    # Long sums of intervals show the drift too, whose part is taken off.
    assert found["interval_noise"].value == pytest.approx(TRUTH.interval_noise, rel=0.25)


def test_duplicated_rows_are_named_and_written(tmp_path: Path) -> None:
    """Equal rows had no line in what was found, and none in what does not fit."""
    result = calibrated()
    assert result.duplicated == ((0, 2), (1, 3))
    assert result.document()["duplicated_rows"] == [[0, 2], [1, 3]]
    assert result.parameters["duplicated_rows"].text == "2 shows 0, 3 shows 1"
    text = preset_text(result)
    assert text is not None
    sensor = tomllib.loads(text)["sensor"]
    assert sensor["duplicated_rows"] == [[0, 2], [1, 3]]
    (tmp_path / "camera.toml").write_text(text)
    _, made = load(
        "film",
        [f"sensor.preset={tmp_path / 'camera.toml'}", "sensor.threshold=20000 e", "duration=2 ms"],
    )
    assert made.sensor.duplicated_rows == ((0, 2), (1, 3))  # type: ignore[union-attr]
    setting = camera_setting(made)  # type: ignore[arg-type]
    assert setting.row_timing.jitter == sensor["row_jitter"]
    assert setting.drift == sensor["drift"]
    pattern = sensor["pattern"]
    assert setting.pattern.along_row == pattern["neighbours_in_row"] > 0.25
    assert np.hypot(pattern["prnu"], pattern["row_fpn"]) == pytest.approx(
        result.parameters["gain_spread"].value, rel=1e-9
    )


def test_rows_that_tell_nothing_are_not_duplicates() -> None:
    """Dark rows are equal, and saturated ones are."""
    lux = np.zeros((12, 16), np.float32)
    setting = Truth(2000.0, 20.0, DevicePattern(), 0.0, (12, 16)).setting(1)
    lux[4:8] = 0.3 / setting.rate(1.0)
    lux[8:] = 30 / setting.rate(1.0)
    assert duplicated_rows(read_trains(film(setting, lux, 128), "")) == ()


def test_a_plain_camera_has_nothing_in_common() -> None:
    truth = Truth(20_000.0, 100.0, DevicePattern(prnu=0.025), 0.0, SHAPE)
    result = calibrate(Recording("plain", truth.record(0.3, CYCLES, 5)))
    found = result.parameters
    assert found["row_jitter"].value is None and result.duplicated == ()
    assert found["drift"].ci[0] == 0
    for name in ("row_fpn", "neighbours_in_row", "neighbours_in_column"):
        assert found[name].value == 0, name
    text = preset_text(result)
    assert text is not None
    assert not {"drift", "row_jitter", "duplicated_rows"} & set(tomllib.loads(text)["sensor"])


@pytest.mark.slow
def test_limits_hold_over_cameras() -> None:
    """Of 20 devices and runs, 17 or more have each truth within its limits of 95 %."""
    held: dict[str, int] = dict.fromkeys(("drift", "row_fpn", "row", "column"), 0)
    for seed in range(20):
        pattern = DevicePattern(
            prnu=0.02, rows=0.006, along_row=0.3, along_column=0.15, width=60, device_seed=seed
        )
        truth = Truth(20_000.0, 100.0, pattern, 0.0, (40, 60))
        trains = read_trains(truth.record(0.3, 4096, seed, drift=2e-3), "")
        good = np.ones(2400, bool)
        drift = measure_drift(trains, good)
        lines = measure_lines(trains, good, np.zeros(2400), truth.interval_noise**2)
        assert drift is not None and lines is not None
        high = drift.ci[1]
        held["drift"] += drift.ci[0] <= 2e-3 and (high is None or high >= 2e-3)
        for name, (value, error), true in (
            ("row_fpn", lines.row, 0.006**2), ("row", lines.along_row, 0.3),
            ("column", lines.along_column, 0.15),
        ):  # fmt: skip
            held[name] += abs(value - true) < 2 * error
    assert min(held.values()) >= 17, held


def test_counts_that_share_spikes_at_their_ends_are_no_drift() -> None:
    """Pixels without a drift: its lower limit is above 0 in 2.5 % of the recordings, and a drift
    that is not known is none in the parameters."""
    rng, cycles, above = np.random.default_rng(3), 2048, 0
    for _ in range(400):
        rate = 0.2 * (1 + 0.03 * rng.standard_normal((6, 8)))
        at = np.floor(rng.random((6, 8)) + rate * np.arange(cycles + 1)[:, None, None])
        trains = read_trains(Viform.from_planes(np.diff(at, axis=0).astype(np.uint8), CLOCK), "")
        drift = measure_drift(trains, np.ones(48, bool))
        assert drift is not None
        above += drift.ci[0] > 0
        if not drift.known:
            parameter = drift_parameter(drift)
            assert parameter.value == 0 and parameter.ci == (0, drift.ci[1])
    assert above < 17
