"""A device's own settings reach its pixels: pattern, reset rule, threshold noise, dead time."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.files import open_stream
from cosim.viform import count_spikes
from scenarios.cli import _main

SMALL = ["--set", "sensor.chip=spikeone", "--set", "duration=6.4 ms", "--set", "scene.at=6 ms"]


def step(folder: Path, *assignments: str) -> list[str]:
    words = [word for each in assignments for word in ("--set", each)]
    return ["run", "step", *SMALL, *words, "--out", str(folder), "--json"]


def test_every_setting_is_kept_by_name_and_changes_the_stream(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = {
        "plain": ([], []),
        "PRNU": (["sensor.pattern.prnu=0.05"], ["PRNU"]),
        "dark": (
            ["sensor.pattern.dark_current=4e5 e/s", "sensor.pattern.temperature=38 degC"],
            ["dark current and DSNU"],
        ),
        "noise": (["sensor.threshold_noise=50 e"], ["threshold noise"]),
        "dead": (["sensor.dead_time=5 us"], ["reset dead time"]),
        "fpn": (["sensor.pattern.threshold_fpn=0.05"], ["threshold FPN"]),
        "broken": (["sensor.pattern.dead_pixels=0.01"], ["hot and dead pixels"]),
    }
    counts = {}
    for name, (assignments, kept) in settings.items():
        assert _main(step(tmp_path / name, *assignments)) == 0
        document = json.loads(capsys.readouterr().out)
        usual = ["residual carried", "random initial charge", "shot noise"]
        assert document["plan"]["kept"] == [*usual, *kept]
        counts[name] = count_spikes(open_stream(tmp_path / name), 0, 240).astype(float)
    mean = counts["plain"].mean()
    # Bars of 1/8 to 8/8 of the light before the step, 0.1 of white, which fires at 0.6 a cycle.
    assert mean == pytest.approx(240 * 0.06 * 4.5 / 8, rel=0.01)
    # 4e5 e/s doubled twice are 40 electrons a cycle, 0.04 thresholds.
    assert counts["dark"].mean() - mean == pytest.approx(240 * 0.04, rel=0.02)
    assert counts["broken"].mean() / mean == pytest.approx(0.99, abs=0.003)
    # 5 us of 25 are a fifth of a cycle: rate / (1 + 0.2 rate) at each bar.
    rates = 0.06 * np.arange(1, 9) / 8
    expected = 240 * (rates / (1 + 0.2 * rates)).mean()
    assert counts["dead"].mean() == pytest.approx(expected, rel=0.003)
    for name in ("PRNU", "noise", "fpn"):
        assert not np.array_equal(counts[name], counts["plain"])
        assert counts[name].mean() == pytest.approx(mean, rel=0.02)


def test_a_device_is_its_seed_whatever_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # One bar's counts in two runs: what stays is the device.
    def counts(name: str, seed: int, device: int) -> np.ndarray:
        words = step(
            tmp_path / name, "sensor.pattern.prnu=0.3", f"sensor.pattern.device_seed={device}"
        )
        assert _main([*words, "--seed", str(seed)]) == 0
        capsys.readouterr()
        return count_spikes(open_stream(tmp_path / name), 0, 240)[:, -40:].ravel().astype(float)

    one, again, other = counts("a", 1, 5), counts("b", 2, 5), counts("c", 1, 6)
    assert np.corrcoef(one, again)[0, 1] > 0.8
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.06


@pytest.mark.parametrize(
    ("assignment", "text"),
    [
        ("sensor.dead_time=1 ms", "sensor.dead_time must be at most a cycle"),
        ("sensor.reset=soft", "sensor.reset must be"),
        ("sensor.pattern.prnu=-1", "sensor.pattern.prnu must be"),
        ("sensor.pattern.temperature=300 lux", "sensor.pattern.temperature must be a temperature"),
        ("sensor.pattern.dark_current=10 e", "sensor.pattern.dark_current must be a current"),
    ],
)
def test_bad_device_settings_are_one_line(
    assignment: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _main(step(tmp_path / "x", assignment)) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and text in err
    assert not (tmp_path / "x").exists()
