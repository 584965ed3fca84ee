"""The section of continuous photographing, and the study that docs/continuous.md quotes."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from cosim import Clock, InputError
from scenarios.studies.continuous import compare, traces_figure
from sensor import CHIPS, CameraSetting
from sensor.continuous.run import continuous_setting
from sensor.device.pattern import DevicePattern
from sensor.sections.unlatched import ContinuousSection

CAMERA = CameraSetting(CHIPS["spiketwo"], Clock(40_000), 1000.0, 5, 600.0)


def test_the_section_reads_units_and_fills_in_the_floor() -> None:
    section = ContinuousSection.model_validate({"time_constant": "1 ms", "contrast": 0.2})
    made = continuous_setting(section, CAMERA)
    assert (made.clock, made.seed, made.wavelength_nm) == (CAMERA.clock, 5, 600.0)
    assert made.electrons_per_lux == CAMERA.electrons_per_lux
    assert made.floor == 36 / (2 * 1e-3 * 0.2)
    assert made.report_bits == 10 + 10 + 14
    given = ContinuousSection.model_validate({"contrast": 0, "floor": "2e5 e/s", "bits": 8})
    assert continuous_setting(given, CAMERA).floor == 2e5


@pytest.mark.parametrize(
    "bad",
    [{"time_constant": "0 s"}, {"time_constant": 1e-3}, {"contrast": -0.1}, {"floor": "0 e/s"},
     {"measure": "-1 s"}, {"bits": 25}, {"exponent_bits": 7}, {"full_scale": "3 lux"},
     {"tau": "1 ms"}],
)  # fmt: skip
def test_the_section_refuses(bad: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        ContinuousSection.model_validate(bad)


@pytest.mark.parametrize(
    ("section", "pattern", "says"),
    [
        ({"bits": 4}, None, r"exponent_bits must be below sensor\.continuous\.bits = 4, not 5"),
        ({"contrast": 0}, None, "floor must be given where contrast is 0"),
        ({}, DevicePattern(threshold_fpn=0.01), "threshold_fpn must be 0"),
    ],
)
def test_what_does_not_go_together_is_refused_in_one_line(section, pattern, says: str) -> None:
    camera = dataclasses.replace(CAMERA, pattern=pattern)
    with pytest.raises(InputError, match=says):
        continuous_setting(ContinuousSection.model_validate(section), camera)


def test_the_figure_is_drawn(tmp_path: Path) -> None:
    # 16 ms: steady at 0.2 of white, from 8 ms at 0.5.
    smooth, noisy, measured = traces_figure(tmp_path / "a.png", 640)
    image = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_COLOR)
    assert image is not None
    assert min(image.shape[:2]) > 500
    reported = np.abs(image.astype(int) - (0x0F, 0x48, 0xD9)).max(axis=2) <= 2  # B, G, R
    assert reported.sum() > 100
    # steps of 10 % or, where the current outruns a tick, more, to within 10 % of 0.5
    assert (smooth.value[1:] >= smooth.value[:-1] * 1.1 * (1 - 2e-3)).all()
    assert abs(smooth.value[0] / 24e6 - 0.2) < 1e-3
    assert 0.5 / 1.1 <= smooth.value[-1] / 24e6 < 0.5
    assert 6 <= len(noisy) <= 16
    # a mean of 1 ms has a deviation of sqrt(i / 1 ms), 0.9 % of it at 0.5 of white
    assert abs(measured.value[-1] / 12e6 - 1) < 4.9 * (12e6 * 1e-3) ** -0.5


def test_the_study_of_a_step() -> None:
    rows = {row.sensor: row for row in compare((8, 32), ("step",))}
    spikes, reports = rows["spikes, TFP"], rows["continuous, defaults"]
    # bars of b/8: 0.3 of the light for 30 ms, then 0.9 for 34 ms; white makes 0.6 a cycle
    mean = 0.6 * 40_000 * (0.3 * 30 + 0.9 * 34) / 64 * np.mean(np.arange(1, 9) / 8)
    assert abs(spikes.reports / mean - 1) < 0.01
    assert reports.bits == reports.reports * (3 + 5 + 14)
    assert reports.bits < spikes.bits / 5
    assert reports.psnr > 30
