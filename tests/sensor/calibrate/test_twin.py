"""The films of a preset are draws of the law of the recording that it is of."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from scenarios.cli.study.calibrate import _text
from sensor.calibrate import page, twin
from sensor.calibrate.page import preset_text, write_calibration
from sensor.device.pattern import DevicePattern
from tests.sensor.calibrate.simulated import Truth
from tests.sensor.calibrate.test_calibration import calibrated as of_random_camera
from tests.sensor.calibrate.test_common import calibrated


@pytest.mark.slow
def test_the_preset_filmed_cannot_be_told_from_the_recording(tmp_path: Path) -> None:
    result = calibrated()
    text = preset_text(result)
    assert text is not None and result.still is not None
    path = tmp_path / "camera.toml"
    path.write_text(text)
    same = twin.compare_twin(*result.still, path)
    assert same.verdict == "the preset's films cannot be told from the recording"
    assert len(same.statistics) > 12 and min(each.chance for each in same.statistics) > 0.002
    # Without what was found it can: the preset as it was written before.
    kept = [
        line
        for line in text.splitlines()
        if not line.startswith(("neighbours", "row_", "drift", "duplicated", " ", "]"))
    ]
    path.write_text("\n".join(kept))
    other = twin.compare_twin(*result.still, path)
    assert "neighbours in a row" in other.document()["told_by"]
    assert "pairs of duplicated rows" in other.document()["told_by"]
    assert other.verdict.startswith("the recording can be told from the preset's films by ")


def test_chances_are_judged_together() -> None:
    rng = np.random.default_rng(1)
    told = 0
    for _ in range(400):
        draws = rng.standard_normal((10, twin.FILMS + 1))
        told += any(twin._holm([twin._chance(row[0], row[1:]) for row in draws]))
    assert 6 < told < 36  # 5 % of 400 comparisons of ten statistics
    assert twin._chance(2.0, np.full(8, 2.0)) == 1 and twin._chance(2.0, np.zeros(8)) == 0
    assert twin._holm([0.04, 0.001, 0.9]) == [False, True, False]


def test_a_film_has_the_rate_of_the_recording_with_dark_current_and_dead_time(
    tmp_path: Path,
) -> None:
    """Dark current of which a pixel has more or less, a threshold that spreads, and dead time."""
    path = tmp_path / "camera.toml"
    path.write_text(
        """[sensor]
width = 64
height = 96
clock = "40 kHz"
threshold = "2000 e"
dead_time = "1.5 us"
[sensor.pattern]
prnu = 0.02
threshold_fpn = 0.12
dsnu = 0.3
[of_threshold]
interval_noise = 0.025
dark_current = 1200.0
"""
    )
    films = [twin.film_preset(path, np.full((96, 64), 0.3), 512, n) for n in (1, 2)]
    rates = np.array([film.rate() for film in films], np.float64)
    assert rates.mean() == pytest.approx(0.3, abs=4 * float(rates.std()) / rates.size**0.5)


@pytest.mark.slow
def test_cameras_of_the_model_are_told_from_their_twins_as_often_as_stated(tmp_path: Path) -> None:
    """Three flats and a dark recording of 20 random cameras: LEVEL of them, 1, and 4 at most."""
    told = []
    for seed in range(20):
        result = of_random_camera(seed)[1]
        text = preset_text(result)
        assert text is not None and result.still is not None
        path = tmp_path / f"{seed}.toml"
        path.write_text(text)
        compared = twin.compare_twin(*result.still, path)
        told += [(seed, compared.verdict)] if compared.document()["told_by"] else []
    assert len(told) <= 4, told


def test_what_tells_the_twin_does_not_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = twin.Compared("Fano factor of 16 cycles", 0.03, 0.02, 0.001, 1e-5, True)
    monkeypatch.setattr(page, "compare_twin", lambda *_: twin.Twin((row,), 992))
    document = write_calibration(calibrated(), tmp_path, time.perf_counter())
    assert "Fano factor of 16 cycles" in document["does_not_fit"][-1]
    text = "\n".join(_text(calibrated(), document, tmp_path))
    assert "what does not fit\n  nothing" not in text
    report = (tmp_path / "report.html").read_text()
    assert "within chance" not in report and "differ from the recording in Fano" in report


def test_spikes_of_dead_pixels_in_the_dark_are_not_noise() -> None:
    """A flat does not tell dark current, so a twin's dead pixels are silent: a recording in which
    they have some spikes must not differ by it from the same one without dead pixels."""
    found = []
    for dead in (0.02, 0.0):
        pattern = DevicePattern(prnu=0.02, dark=2e5, dsnu=0.1, dead=dead, device_seed=3)
        found.append(twin.statistics(Truth(900.0, 0.0, pattern, 0.0).record(0.3, 2048, 1)))
    for name in ("variance of an interval, cycles^2", "Fano factor of 16 cycles",
                 "Fano factor of 64 cycles"):  # fmt: skip
        assert found[0][name] == pytest.approx(found[1][name], rel=0.01), name
