"""ColorVideoVDP runs in a process of its own, where it is installed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cosim import PS
from display.observe.slow_motion import SlowMotion
from display.quality import colorvideovdp
from display.quality.colorvideovdp import color_video_vdp

MOTION = SlowMotion((8, 12), 0, PS // 5, PS // 1000, 2)
"""200 frames at 1000 Hz, of which the last 150 count, in groups of 2."""
PACKAGE = """
import numpy as np
class cvvdp:
    def __init__(self, display_photometry, display_geometry, quiet):
        self.set = display_photometry, display_geometry
    def predict(self, test, truth, dim_order, frames_per_second):
        assert dim_order == "FHW" and frames_per_second == 500
        assert test.shape == truth.shape == (75, 4, 6) and test.dtype == np.float32
        assert self.set == ((300.0, 1e6, "linear"), ((6, 4), 30.0)), self.set
        return 10 - np.abs(test - truth).max(), None
"""
MODEL = """
def vvdp_display_photo_eotf(peak, contrast, EOTF): return peak, contrast, EOTF
def vvdp_display_geometry(resolution, ppd): return tuple(resolution), ppd
"""


@pytest.fixture
def frames() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    truth = rng.integers(0, 256, (MOTION.count, *MOTION.shape), dtype=np.uint8)
    white = np.full_like(truth, 255)
    early = truth.copy()
    early[: MOTION.count // 4] = 0  # before the frames that count
    return {"truth": truth, "spike": truth.copy(), "60 Hz": white, "dark at first": early}


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of this name, found by this process and by its child."""
    package = tmp_path / "pycvvdp"
    package.mkdir()
    (package / "__init__.py").write_text(PACKAGE)
    (package / "display_model.py").write_text(MODEL)
    monkeypatch.syspath_prepend(str(tmp_path))
    return package


def test_frames_are_compared_in_linear_light(frames, installed):
    jod = color_video_vdp(frames, "truth", MOTION, 60.0, 300.0)
    assert jod["spike"] == 10 and jod["dark at first"] == 10
    pairs = frames["truth"][50:].reshape(75, 2, *MOTION.shape) / 255
    low, high = pairs / 12.92, ((pairs + 0.055) / 1.055) ** 2.4
    light = np.where(pairs <= 0.04045, low, high).mean(axis=1)
    assert jod["60 Hz"] == pytest.approx(10 - 300 * (1 - light.min()), rel=1e-5)


def test_a_package_that_fails_gives_no_value(frames, installed, capsys):
    (installed / "__init__.py").write_text("raise RuntimeError('no torch')")
    jod = color_video_vdp(frames, "truth", MOTION, 60.0, 300.0)
    assert set(jod) == {"spike", "60 Hz", "dark at first"} and all(map(math.isnan, jod.values()))
    assert "ColorVideoVDP failed" in capsys.readouterr().err


def test_without_the_package_there_is_no_metric(frames, monkeypatch):
    monkeypatch.setattr(colorvideovdp, "find_spec", lambda name: None)
    assert color_video_vdp(frames, "truth", MOTION, 60.0, 300.0) == {}
