"""The preset `silicon` has the laws of a recording of a 400 x 250 chip (docs/laboratory.md)."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from scenarios.cli.entry import _main

RUN = (
    "sensor.chip=spikeone", "sensor.preset=silicon", "sensor.threshold=100000 e",
    "scene.illuminance=70000 lux", "sensor.lens.white_rate=0.4", "duration=12.5 ms",
)  # fmt: skip


def common_variance(folder: Path, words: list[str], seed: int) -> float:
    """Of another run of the same scene, against counts of independent pixels."""
    out = str(folder / f"run {seed}")
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert _main(["run", "film", *words, "--seed", str(seed), "--json", "--out", out]) == 0
        said.seek(0)
        said.truncate()
        assert _main(["laboratory", out, "--json"]) == 0
    return float(json.loads(said.getvalue())["common_variance"])


@pytest.mark.slow
def test_the_preset_has_the_laws_of_a_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    light = np.tile(np.linspace(0.3, 1, 400), (250, 1))  # no step as large as the fixed pattern
    curve = 1.055 * light ** (1 / 2.4) - 0.055
    cv2.imwrite(str(tmp_path / "gradient.png"), np.rint(curve * 65535).astype(np.uint16))
    sets = [f"scene.path={tmp_path / 'gradient.png'}", *RUN]
    words = [word for each in sets for word in ("--set", each)]
    assert _main(["run", "film", *words, "--json", "--out", str(tmp_path / "run")]) == 0
    capsys.readouterr()
    assert _main(["laboratory", str(tmp_path / "run"), "--json"]) == 0
    laws = json.loads(capsys.readouterr().out)
    recorded = {2.5: 0.247, 3.0: 0.050, 4.0: 0.053, 6.0: 0.057, 8.0: 0.061}
    for law in laws["intervals"]:
        assert 0.9 * recorded[law["mean"]] < law["variance"] < 1.1 * recorded[law["mean"]]
        if law["mean"] in (3.0, 4.0, 6.0):  # recorded: -0.148, -0.128, -0.165
            assert -0.175 < law["correlation"] < -0.12
    # The recording has 4.31. It differs from run to run, as a drift does.
    common = [laws["common_variance"], *(common_variance(tmp_path, words, n) for n in range(2, 7))]
    assert 1 < np.median(common) < 12 and max(common) < 50
    assert 0.026 < laws["core_spread"] < 0.031
    assert 40 < laws["above"] < 80 and 0.15 < laws["highest"] < 0.45 and laws["kurtosis"] > 30
