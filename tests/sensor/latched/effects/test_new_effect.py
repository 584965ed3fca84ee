"""A pixel effect that this file alone adds: a light-dependent gain, from its key to the report.

The increment x of a cycle becomes x (1 + min(k x / Q, 1)). Run as a program, this file registers
the effect and then is the command `viform`.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from pydantic import Field

from cosim import Bound, Clock, Light, Summary
from cosim.compute.opencl import open_device
from cosim.light.light import Piece
from sensor import CHIPS, CameraSetting, make_pixels
from sensor.latched.effects.catalogue import CATALOGUE, register
from sensor.latched.effects.effect import Key, PixelEffect, Setting
from sensor.latched.effects.residual import RESIDUAL
from sensor.latched.effects.windows import bound_of, light_contrast, shift_error
from sensor.latched.exposure import Exposure
from sensor.latched.fast import FastPixels, PixelArray
from sensor.latched.pixel.charge import Transfer
from sensor.latched.pixel.model import ExactModel
from sensor.latched.pixel.numpy_form import NumpyPixels
from sensor.latched.tiers import Tier, tier_pixels
from tests.sensor.latched.fast.numpy_fast import NumpyFast

CLOCK = Clock(40_000)
PERIOD = CLOCK.edge(1)
ROOT = Path(__file__).resolve().parents[4]


class LightGain(PixelEffect):
    """Gain that grows with light: k is its relative growth at a threshold a cycle."""

    name = "light-dependent gain"
    source = "test: x (1 + min(k x / Q, 1))"
    parameters: ClassVar = {"gain_slope": 0.0}
    keys: ClassVar = {
        "gain_slope": Key(
            Annotated[float, Field(ge=0, le=1)],
            Field(default=0.0, description="growth of the gain at a threshold a cycle, relative"),
        )
    }

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        share = np.minimum(setting.gain_slope * scene.brightest / scene.threshold, 1.0)
        shift = share * scene.brightest * scene.cycles / scene.threshold
        return bound_of(scene, share * light_contrast(scene) + shift_error(scene, shift), True)

    def cost(self, scene: Summary) -> Any:
        return 0.05

    def transfer(self, setting: Setting) -> Transfer:
        k = float(np.float32(setting.gain_slope))
        per_electron = round(setting.gain_slope / setting.threshold * 2**30)

        def charge(x: Any) -> Any:
            electrons = x >> 30  # in 2^-10 of one
            return x + electrons * np.minimum((electrons * per_electron) >> 10, 1 << 30)

        return Transfer(
            share=lambda x: x * (1.0 + np.minimum(k * x, 1.0)),
            charge=charge,
            share_cl=f"return x * (1.0f + fmin({k.hex()}f * x, (float16)(1.0f)));",
            charge_cl="const long16 electrons = x >> 30;\n"
            f"return x + electrons * min((electrons * {per_electron}L) >> 10, "
            "(long16)(1L << 30));",
            most=2.0,
        )


def viform(*words: str) -> dict[str, Any]:
    """The document of `viform WORDS --json`, with the effect registered."""
    done = subprocess.run(
        [sys.executable, __file__, *words, "--json"], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


SCENARIO = (
    "step", "--set", "sensor.chip=spikeone", "--set", "duration=4 ms", "--set", "image.at=[80]",
    "--set", "scene.at=2 ms",     "--set", "sensor.gain_slope=0.05",
)  # fmt: skip


@pytest.mark.parametrize("device", [pytest.param("numba", marks=pytest.mark.slow), "opencl"])
def test_it_is_kept_at_tolerance_0_and_stands_in_the_report(tmp_path: Path, device: str) -> None:
    words = ("--device", "numba") if device == "numba" else ()
    result = viform("run", *SCENARIO, *words, "--tolerance", "0", "--out", str(tmp_path / "run"))
    assert result["outcome"] == "ok" and LightGain.name in result["plan"]["kept"]
    assert result["plan"]["left_out"] == []
    assert result["error"]["ci"][1] < 1e-3  # the exact tier against the reference
    report = (tmp_path / "run" / "report.html").read_text()
    assert LightGain.source in report  # the table of effects
    assert "<td>gain slope</td><td>0.05</td><td>scenario</td>" in report.replace("\n", "")
    assert "gain_slope = 0.05" in (tmp_path / "run" / "scenario.toml").read_text()


def test_a_loose_tolerance_leaves_it_out_and_the_check_measures_it(tmp_path: Path) -> None:
    result = viform("run", *SCENARIO, "--tolerance", "0.8", "--out", str(tmp_path / "run"))
    (row,) = [r for r in result["plan"]["left_out"] if r["effect"] == LightGain.name]
    assert 0 < row["measured"] <= row["bound"] < 0.4 and row["kind"] == "estimate"
    assert 0.01 < result["error"]["value"] <= result["error"]["ci"][1] < 0.8


@pytest.mark.slow
def test_plan_and_accuracy_know_it() -> None:
    plan = viform("plan", *SCENARIO)
    (row,) = [r for r in plan["rows"] if r["effect"] == LightGain.name]
    assert row["kept"] == 1 and row["bound"] > 0
    rows = viform("accuracy", *SCENARIO)["rows"]
    assert {"exact", "fast", "reference"} == {r["tier"] for r in rows}
    assert all(r["error"] < 1e-3 for r in rows if r["tolerance"] in (None, 0))


@pytest.fixture
def setting(monkeypatch: pytest.MonkeyPatch) -> CameraSetting:
    """A camera with the effect, which is in the catalogue during the test."""
    monkeypatch.setattr("sensor.latched.effects.catalogue.CATALOGUE", [*CATALOGUE])
    register(LightGain())
    chip = replace(CHIPS["spikeone"], width=21, height=6)
    return CameraSetting(chip, CLOCK, 300.0, 4, dead_time=1e-6, gain_slope=0.3)


def test_a_name_that_is_taken_is_refused(setting: CameraSetting) -> None:
    with pytest.raises(ValueError, match=r"must be new, not .*gain_slope"):
        register(LightGain())


def test_numba_opencl_and_plain_numpy_give_the_same_bits(setting: CameraSetting) -> None:
    # Steady light, ramps longer and shorter than a word, a change within a cycle; up to 3
    # thresholds a cycle.
    random, n = np.random.default_rng(2), 126
    levels = [(random.random((6, 21)) ** 3 * 900).astype(np.float32) for _ in range(5)]
    knots = [0, 33 * PERIOD + 7, 40 * PERIOD, 90 * PERIOD + 5, 130 * PERIOD]
    pieces = [
        Piece(start, stop, levels[k], levels[k] if k == 1 else levels[k + 1])
        for k, (start, stop) in enumerate(pairwise(knots))
    ]
    light, numbers = Light(tuple(pieces)), np.arange(n, dtype=np.uint32)
    for reset in ("residual", "hard", "subtract"):
        model = replace(setting, reset=reset).model
        assert len(model.transfers) == 1
        forms = [make_pixels(model, numbers, d) for d in (None, open_device())]
        forms.append(NumpyPixels(model, numbers))
        spans = Exposure(CLOCK, 40_000.0).spans(light, 0, 128)
        words = [form.expose(spans, 128) for form in forms]
        assert np.array_equal(words[0], words[2]) and np.array_equal(words[1], words[2])
        plain = ExactModel(300.0, 4, model.effects, reset=reset, dead_time=model.dead_time)
        assert not np.array_equal(words[2], NumpyPixels(plain, numbers).expose(spans, 128))
        array = PixelArray(model, (6, 21), numbers, CLOCK, 40_000.0)
        found, expected = FastPixels(array, open_device()), NumpyFast(array)
        assert np.array_equal(found.expose(light, 0, 128), expected.expose(light, 0, 128))


@pytest.mark.parametrize("tier", ["reference", "exact", "fast"])
def test_the_rate_is_that_of_the_closed_form(setting: CameraSetting, tier: Tier) -> None:
    # u thresholds a cycle become u (1 + k u), less a dead time d of each interval.
    share = 0.4
    lux = np.full((6, 21), share / setting.rate(1.0), np.float32)
    light, numbers = Light((Piece(0, 10**12, lux, lux),)), np.arange(126, dtype=np.uint32)
    pixels = tier_pixels(tier, setting, (6, 21), numbers, np.arange(6), open_device())
    cycles, count = 6400, -pixels.fraction()
    for start in range(0, cycles, 640):
        count += np.bitwise_count(pixels.expose(light, start, 640)).sum(axis=0)
    rate = (count + pixels.fraction()) / cycles
    bright = share * (1 + 0.3 * share)
    expected = bright / (1 + bright * 1e-6 * 40_000)
    # The mean over 126 pixels of a rate with the noise of 1 / 300 an interval, 5 deviations.
    noise = 5 * expected / math.sqrt(300 * expected * cycles * 126)
    assert rate.mean() == pytest.approx(expected, abs=noise + 1e-6)


def test_the_reference_integrates_a_ramp(setting: CameraSetting) -> None:
    # Over a ramp from 0 to u the mean of u' (1 + k u') is u / 2 + k u^2 / 3.
    quiet = replace(setting, effects=(RESIDUAL,), parameters={"gain_slope": 0.3})
    dark = np.zeros((6, 21), np.float32)
    lux = np.full((6, 21), 0.6 / quiet.rate(1.0), np.float32)
    light, numbers = Light((Piece(0, 640 * PERIOD, dark, lux),)), np.arange(126, dtype=np.uint32)
    gathered = (0.6 / 2 + 0.3 * 0.6**2 / 3) * 640
    for tier in ("reference", "exact", "fast"):
        pixels = tier_pixels(tier, quiet, (6, 21), numbers, np.arange(6), open_device())
        bits = sum(
            np.bitwise_count(pixels.expose(light, start, 64)).sum(axis=0)
            for start in range(0, 640, 64)
        )
        assert bits + pixels.fraction() == pytest.approx(gathered, rel=2e-5)


if __name__ == "__main__":
    register(LightGain())
    from scenarios.cli import main

    sys.exit(main())
