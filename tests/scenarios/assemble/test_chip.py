"""A device's own settings reach its pixels: pattern, reset rule, threshold noise, dead time."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from cosim import InputError, SpikeStream
from cosim.config.toml import to_toml
from cosim.files import open_stream
from cosim.run.machine import Options
from cosim.run.progress import QuietProgress
from cosim.run.result import Result
from cosim.spikes.viform import count_spikes
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.messages import validate
from scenarios.cli.entry import _main
from scenarios.run import run_scenario
from sensor import CHIPS, CameraSetting
from sensor.latched.effects.catalogue import all_keys
from sensor.latched.effects.own_draws import OWN_DRAWS
from sensor.sections.sensor import LEVELS

SMALL = ["--set", "sensor.chip=spikeone", "--set", "duration=6.4 ms", "--set", "scene.at=6 ms"]


def step(folder: Path, *assignments: str) -> list[str]:
    words = [word for each in assignments for word in ("--set", each)]
    return ["run", "step", *SMALL, *words, "--out", str(folder), "--json"]


def filmed(folder: Path, *assignments: str) -> tuple[Result, SpikeStream]:
    """The same run without its report, which most of these tests have no eyes for."""
    given = [*SMALL[1::2], *assignments]
    name, scenario = load("step", given)
    done = run_scenario(
        name, scenario, folder, options=Options(), progress=QuietProgress(), began=0.0,
        report=lambda machine, run: [],
    )  # fmt: skip
    return done.result, open_stream(done.folder)


def test_every_setting_is_kept_by_name_and_changes_the_stream(tmp_path: Path) -> None:
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
        "rows": (["sensor.row_skew=1"], ["row-by-row sampling"]),
        "delay": (["sensor.comparator_delay=5 us"], ["comparator delay"]),
        "crosstalk": (["sensor.crosstalk=0.1"], ["optical cross-talk"]),
    }
    counts, totals = {}, {}
    for name, (assignments, kept) in settings.items():
        result, stream = filmed(tmp_path / name, *assignments)
        usual = ["residual carried", "random initial charge", "shot noise"]
        found = [effect for effect in result.document()["plan"]["kept"] if effect != OWN_DRAWS]
        assert found == [*usual, *kept]
        counts[name] = count_spikes(stream, 0, 240).astype(float)
        totals[name] = count_spikes(stream, 0, 256).astype(float)
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
    # The last of 240 cycles ends as the light jumps: rows sampled half a cycle later on average
    # see that much of the brighter light. A delay of 5 us sees it a fifth of a cycle later.
    # Cross-talk moves light sideways.
    step_mean = (0.9 - 0.1) * 0.6 * 4.5 / 8
    assert counts["rows"].mean() - mean == pytest.approx(0.5 * step_mean, abs=0.01)
    assert np.array_equal(counts["delay"], counts["plain"])
    gone = totals["plain"].mean() - totals["delay"].mean()
    assert gone == pytest.approx(0.2 * step_mean, abs=0.01)
    assert counts["crosstalk"].mean() == pytest.approx(mean, abs=0.01)
    assert not np.array_equal(counts["crosstalk"], counts["plain"])
    for name in ("PRNU", "noise", "fpn"):
        assert not np.array_equal(counts[name], counts["plain"])
        assert counts[name].mean() == pytest.approx(mean, rel=0.02)


def test_a_device_is_its_seed_whatever_the_run(tmp_path: Path) -> None:
    # One bar's counts in two runs: what stays is the device.
    def counts(name: str, seed: int, device: int) -> np.ndarray:
        _, stream = filmed(
            tmp_path / name, f"seed={seed}", "sensor.pattern.prnu=0.3",
            f"sensor.pattern.device_seed={device}",
        )  # fmt: skip
        return count_spikes(stream, 0, 240)[:, -40:].ravel().astype(float)

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


def camera(*assignments: str) -> CameraSetting:
    return camera_setting(load("step", [f"sensor.{each}" for each in assignments])[1])


def test_threshold_levels_are_sixteenths() -> None:
    found = [camera("threshold=1600 e", f"threshold_level={n}").threshold for n in range(1, 17)]
    assert found == [100.0 * n for n in range(1, 17)]
    for chip in CHIPS.values():
        assert chip.threshold_levels == LEVELS
    with pytest.raises(InputError, match=r"threshold_level must be .* at least 1 e, not 1 of 15 e"):
        camera("threshold=15 e", "threshold_level=1")
    with pytest.raises(InputError, match="at most 16"):
        camera("threshold_level=17")


def test_a_level_scales_the_rate_of_the_same_light(tmp_path: Path) -> None:
    totals = {}
    for level, hz in ((16, 40_000), (4, 40_000), (16, 20_000)):
        _, stream = filmed(
            tmp_path / f"{level}-{hz}", "sensor.lens.f_number=8", "scene.illuminance=60 lux",
            f"sensor.clock={hz} Hz", f"sensor.threshold_level={level}", "scene.before=1",
            "scene.after=1",
        )  # fmt: skip
        assert stream.clock.hz == hz and stream.cycles == hz * 64 // 10_000
        totals[level, hz] = count_spikes(stream, 0, stream.cycles).sum()
    # White at 60 lux, f/8: 0.017 of 1000 e a 25 us cycle; a quarter of the threshold fires four
    # times as often, half the clock as often in the same time.
    assert totals[4, 40_000] / totals[16, 40_000] == pytest.approx(4, rel=0.005)
    assert totals[16, 20_000] / totals[16, 40_000] == pytest.approx(1, rel=0.005)


def test_a_capacitance_adds_its_reset_noise() -> None:
    # sqrt(k T C) / q: 28.4 e at 5 fF and 300 K (26.85 degC).
    setting = camera("capacitance=5 fF", "pattern.temperature=26.85 degC", "threshold_noise=10 e")
    assert setting.threshold_noise == pytest.approx(math.hypot(28.4, 10), rel=1e-3)
    with pytest.raises(InputError, match=r"capacitance must be at most 2\.49 fF, so"):
        camera("capacitance=5 fF", "threshold=20 e")


def test_the_silicon_preset_fills_in_what_is_absent() -> None:
    scenario = load("step", ["sensor.preset=silicon", "sensor.pattern.prnu=0"])[1]
    setting = camera_setting(scenario)
    assert setting.threshold_noise == pytest.approx(0.001 * setting.threshold)
    assert setting.pattern is not None and setting.pattern.prnu == 0
    kept = {effect.name for effect in setting.acting_effects}
    assert kept >= {
        "row-by-row sampling", "comparator delay", "optical cross-talk", "threshold noise",
        "reset dead time", "threshold FPN", "dark current and DSNU", "hot and dead pixels",
        "warm pixels",
    }  # fmt: skip
    assert "PRNU" not in kept
    assert camera("preset=silicon", "threshold_noise=7 e").threshold_noise == 7
    assert camera("preset=silicon", "threshold_level=8").threshold_noise == pytest.approx(0.5)
    # What a run leaves as its scenario makes the same camera, and so does nothing twice.
    again = validate(tomllib.loads(to_toml(scenario)))
    assert again == scenario and camera_setting(again) == setting
    with pytest.raises(InputError, match=r"sensor\.threshold must be a charge"):
        camera("preset=silicon", "threshold=5 lux")
    with pytest.raises(InputError, match=r"sensor\.pattern must be a section"):
        camera("preset=silicon", "pattern=1")


def test_every_size_of_the_preset_says_where_it_is_from() -> None:
    sizes = [key.silicon for _, key in all_keys() if key.silicon is not None]
    assert len(sizes) == 18 and all(sized.value > 0 and sized.source for sized in sizes)
    assert {sized.provenance for sized in sizes} == {"assumed"}
