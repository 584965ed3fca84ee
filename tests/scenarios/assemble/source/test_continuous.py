"""A run with continuous pixels: closed forms through the whole chain, the folder's contract,
refusals, and the bench as a command."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Clock, Interrupted, Light, Piece
from cosim.files.intensities import read_intensities
from cosim.light.steps import light_steps
from cosim.run.machine import Machine, Options, Run
from cosim.run.result import Result
from cosim.run.shown import SilentProgress
from scenarios.assemble.schema.loading import load
from scenarios.report import write_report
from scenarios.run import run_scenario
from sensor.continuous.run import ContinuousRun
from sensor.continuous.shots import PixelLight
from sensor.device.crosstalk import side_share
from tests.scenarios.pages import page_of

SMALL = (
    "sensor.pixel=continuous", "sensor.continuous.width=40", "sensor.continuous.height=16",
)  # fmt: skip
WHITE = 0.6 * 1000 * 40_000
"""Electrons a second of white where the f-number is chosen."""


def shoot(
    out: Path, *sets: str, name: str = "step", report: Any = None
) -> tuple[Result, ContinuousRun]:
    runs: list[ContinuousRun] = []

    def keep(machine: Any, run: Run) -> list[str]:
        runs.append(machine.judged(run))
        return [] if report is None else report(machine, run)

    short, scenario = load(name, list(sets))
    done = run_scenario(
        short, scenario, out, options=Options(), progress=SilentProgress(),
        began=time.perf_counter(), report=keep,
    )  # fmt: skip
    return done.result, runs[0]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, ContinuousRun]:
    """400 cycles of bars whose light jumps ninefold in the middle, with the report."""
    folder = tmp_path_factory.mktemp("runs") / "step"
    sets = ("duration=10 ms", "scene.at=5 ms", "title=A <b>step</b> & more")
    return shoot(folder, *SMALL, *sets, report=write_report)


# Closed forms, from lux to the file.


def test_a_jump_is_reported_in_steps_of_the_contrast(tmp_path):
    """The monitor goes as a + (b - a)(1 - exp(-t / tau)); each report is 1.1 times the one before,
    and the last is the last power of 1.1 below b / a = 9."""
    _, run = shoot(
        tmp_path / "run", *SMALL, "duration=40 ms", "scene.at=2 ms",
        "sensor.continuous.time_constant=4 ms", "sensor.continuous.shot_noise=false",
        "sensor.continuous.floor=1000 e/s",
    )  # fmt: skip
    steps = int(np.log(9) / np.log(1.1))
    assert steps == 23
    reports = read_intensities(run.run.folder / "stream.intensities.npz")
    assert reports == run.views.reports
    assert len(reports) == 640 * (steps + 1)
    k = np.arange(steps + 1)
    times = 2e-3 + 4e-3 * np.log(8 / (9 - 1.1 ** k[1:]))
    ticks = np.concatenate([[0], np.floor(times * 40_000)])
    for column in (2, 17, 37):
        mine = reports.column == column
        # bars of b/8, at a tenth of the light before the jump; half a converter step is 1/1024
        level = WHITE * (column // 5 + 1) / 8 * 0.1 * 1.1**k
        value, tick = (x[mine].reshape(steps + 1, 16) for x in (reports.value, reports.time))
        assert (np.abs(value.T / level - 1) < 1 / 1024 + 1e-6).all()
        assert (ticks == tick.T).all()


def test_cross_talk_is_mixed_into_the_light(tmp_path):
    _, run = shoot(
        tmp_path / "run", *SMALL, "duration=1 ms", "scene.at=0.5 ms", "sensor.crosstalk=0.3",
        "sensor.continuous.shot_noise=false", "image.at=[0]",
    )  # fmt: skip
    row = run.views.shots[0].continuous[8]
    # The last column of bar 1 gives its light away to both sides and gets some of bar 2's.
    mixed = 1 / 8 + side_share(0.3) * (2 / 8 - 1 / 8)
    assert row[4] == pytest.approx(0.1 * mixed, rel=1 / 1024 + 1e-6)
    assert row[2] == pytest.approx(0.1 / 8, rel=1 / 1024 + 1e-6)
    assert run.run.result.kept[-1] == "optical cross-talk"
    # The light kept for the figures is the light that the pixels saw.
    assert len(run.views.light.points) == 8 and run.views.light.when == [
        0,
        5 * 10**8,
        5 * 10**8,
        10**9,
    ]
    lux = np.array(run.views.light.level) * (run.spec.setting.electrons_per_lux / run.spec.white)
    assert lux[:2, 0] == pytest.approx(0.1 / 8) and lux[2:, 7] == pytest.approx(0.9)


def test_noise_is_that_of_the_monitor(tmp_path):
    """First reports of steady light: deviation sqrt(i / 2 tau), Campbell's theorem."""
    _, run = shoot(
        tmp_path / "run", *SMALL, "duration=1 ms", "scene.at=0.9 ms", "image.at=[0]",
        "sensor.continuous.height=200", "sensor.continuous.exponent_bits=0",
        "sensor.continuous.bits=24", "sensor.continuous.full_scale=1e8 e/s",
    )  # fmt: skip
    bar = run.views.shots[0].continuous[:, 35:] * WHITE
    mean, tau = 0.1 * WHITE, 250e-6
    sigma = (mean / (2 * tau)) ** 0.5
    assert abs(bar.mean() - mean) < 4.9 * sigma / bar.size**0.5
    # variance of a sample variance of n normals: 2 / n; 4.9 deviations are alpha 1e-6
    assert abs(bar.var() / sigma**2 - 1) < 4.9 * (2 / bar.size) ** 0.5


@pytest.mark.parametrize("clock", ["40001.25 Hz", "3.3333 Hz"])
def test_a_clock_of_odd_periods_is_run_in_steps_that_its_arithmetic_holds(tmp_path, clock):
    """Still light without noise: every pixel reports once, however long the run."""
    _, run = shoot(
        tmp_path / "run", *SMALL, "duration=1000 s", "scene.before=0.5", "scene.after=0.5",
        f"sensor.clock={clock}", "sensor.lens.f_number=2", "sensor.continuous.shot_noise=false",
        "scene.at=500 s",
    )  # fmt: skip
    assert len(run.views.reports) == 640 and not run.views.reports.time.any()
    assert run.views.reports.ticks == round(1000 * float(clock.split()[0]))


# The folder.


def test_the_folder_is_as_the_design_says(whole):
    result, run = whole
    document = json.loads((run.run.folder / "result.json").read_text(encoding="utf-8"))
    assert document == json.loads(json.dumps(result.document()))
    there = {str(p.relative_to(run.run.folder)) for p in run.run.folder.rglob("*") if p.is_file()}
    assert set(document["files"]) == there
    assert {"report.html", "stream.intensities.npz", "scenario.toml", "result.json"} <= there
    assert {"images/truth-00200.png", "images/continuous-00360.png"} <= there
    error = document["error"]
    assert document["outcome"] == "ok" and 0 < error["value"] <= error["ci"][1] < 1e-3
    assert error["of"] == "law" and error["tiles_checked"] > 0 == error["tiles_over"]
    metrics = {name: m["value"] for name, m in document["metrics"].items()}
    assert metrics["reports"] == len(run.views.reports) > 2 * 640
    assert metrics["report_rate"] == pytest.approx(metrics["reports"] / 640 / 10e-3)
    assert metrics["report_bits"] == 4 + 6 + 14
    assert metrics["bit_rate"] == pytest.approx(metrics["report_rate"] * 24)
    assert metrics["white_current"] == pytest.approx(WHITE)
    # 80 cycles after the jump the image is the bars again, with 10 % contrast in the worst case.
    assert metrics["continuous_psnr"] > 15
    (age,) = document["latency"]
    assert age["stage"] == "report age"
    # By cycle 120 nearly all still show their report at the start.
    assert age["min_us"] >= 0 and age["max_us"] <= 359 * 25


def test_the_page_is_one_file_without_a_network(whole):
    _, run = whole
    page = page_of(run.run.folder)
    assert not re.search("https?:", page)
    assert "<b>step</b>" not in page and "&lt;b&gt;step&lt;/b&gt; &amp; more" in page
    assert page.count("data:image/png;base64,") == 2
    assert page.count("data:image/jpeg;base64,") == 2 * 5 + 2
    assert "4 row + 6 column + 14 value = 24" in page
    text = re.sub(r'base64,[^"]*', "", page).split("<script>")[0]
    assert not re.search(r"\b(nan|inf|None)\b", text)
    for effect in run.run.result.kept:
        assert f"<td>{effect}</td>" in page.replace("&#x27;", "'")
    assert "<td>assumed: the default</td>" in page


def test_the_scenario_in_the_folder_makes_the_same_reports(whole, tmp_path):
    _, run = whole
    _, again = shoot(tmp_path / "again", name=str(run.run.folder / "scenario.toml"))
    assert again.views.reports == run.views.reports
    _, other = shoot(tmp_path / "other", "seed=2", name=str(run.run.folder / "scenario.toml"))
    assert other.views.reports != run.views.reports


def test_an_interrupt_in_the_report_leaves_nothing_that_looks_whole(tmp_path):
    def stop(machine: Machine, run: Run) -> list[str]:
        raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        shoot(tmp_path / "run", *SMALL, "duration=1 ms", report=stop)
    assert not (tmp_path / "run" / "result.json").exists()
    assert not (tmp_path / "run" / "report.html").exists()


# What a user is told.


def test_the_preset_silicon_keeps_what_such_pixels_have(tmp_path):
    sets = (*SMALL, "sensor.preset=silicon", "duration=1 ms", "scene.at=0.5 ms", "image.at=[5]")
    result, run = shoot(tmp_path / "run", *sets)
    assert {"PRNU", "dark current and DSNU", "hot and dead pixels"} <= set(result.kept)
    assert not {"threshold noise", "threshold FPN", "dead time"} & set(result.kept)
    (note,) = (note for note in run.run.notes if "since no pixel spikes: " in note)
    assert note.split(": ")[1].split(", ") == [
        "threshold noise", "dead time", "row skew", "comparator delay", "row jitter", "row wander",
        "drift", "neighbours in row", "neighbours in column", "row fpn", "threshold fpn",
    ]  # fmt: skip
    assert run.spec.setting.pattern is not None and run.spec.setting.pattern.prnu == 0.025
    _, again = shoot(tmp_path / "again", name=str(run.run.folder))
    assert again.views.reports == run.views.reports


def test_pixels_that_measure_are_black_until_they_have(tmp_path):
    result, run = shoot(
        tmp_path / "run", *SMALL, "duration=2 ms", "scene.at=1 ms", "image.at=[10, 79]",
        "sensor.continuous.measure=1 ms", "sensor.continuous.time_constant=1 us",
        "sensor.continuous.full_scale=1.2e7 e/s",
    )  # fmt: skip
    first, last = run.views.shots
    assert first.silent == 640 and not first.continuous.any()
    assert last.silent == 0 and last.continuous.all()
    assert run.run.notes[-1] == "640 pixels had not reported by cycle 10 and are black in its image"
    told = " ".join(run.run.notes)
    assert "more than 0.5 of the light is beyond full_scale" in told
    assert "white brings 24 electrons a time constant" in told
    assert "changes of 7.5 of white or more" in told
    assert {"measuring time", "shot noise"} <= set(result.kept)


def test_steps_may_be_limited():
    clock = Clock(40_000)
    plane = np.ones((1, 1), np.float32)

    class Still:
        def step(self, data: None, block: Any) -> Light:
            return Light((Piece(0, 2**62, plane, plane),))

    def steps(most: int | None) -> list[tuple[int, int]]:
        made = light_steps(Still(), lambda light: light, clock, 10**10, most)  # type: ignore[arg-type]
        return [(start // 25_000_000, stop // 25_000_000) for _, start, stop in made]

    assert steps(None) == [(0, 400)]
    assert steps(150) == [(0, 150), (150, 300), (300, 400)]


def test_light_of_pixels_ends_with_the_run():
    dark, bright = np.zeros((1, 2), np.float32), np.array([[4, 8]], np.float32)
    kept = PixelLight([(0, 1, "a")])
    first, second = Piece(0, 100, dark, bright), Piece(100, 200, bright, dark)
    kept.take(Light((first,)), 150)
    kept.take(Light((first, second)), 150)
    kept.take(Light((second, Piece(200, 300, dark, dark))), 150)
    assert kept.when == [0, 100, 100, 150]
    assert np.array(kept.level)[:, 0].tolist() == [0, 8, 8, 4]


# Refusals.


@pytest.mark.parametrize(
    ("sets", "says"),
    [
        (("sensor.reset=hard",), "sensor.reset must be residual with pixel = continuous, not"),
        (("sensor.threshold_noise=3 e",), "sensor.threshold_noise must be 0 with pixel"),
        (("sensor.capacitance=5 fF",), "sensor.capacitance must be absent with pixel"),
        (("sensor.dead_time=1 us",), "sensor.dead_time must be 0 with pixel = continuous"),
        (("sensor.comparator_delay=1 us",), "sensor.comparator_delay must be 0 with pixel"),
        (("sensor.row_skew=0.5",), "sensor.row_skew must be 0 with pixel = continuous"),
        (("sensor.pattern.threshold_fpn=0.1",), "sensor.pattern.threshold_fpn must be absent"),
        (("sensor.continuous.contrast=0",), "sensor.continuous.floor must be given"),
        (("sensor.continuous.bits=5",), "sensor.continuous.exponent_bits must be below"),
        (("sensor.continuous.width=0",), "sensor.continuous.width must be"),
        (("duration=1 us",), "duration must be at least 2.5e-05 s, one cycle, not 1e-06 s"),
        (("sensor.clock=1e-6 Hz",), "sensor.clock must be at least 1.15741e-05 Hz, a cycle in"),
        (("image.at=[9999]",), "image.at must be cycles below 2560"),
        (("sensor.channel.rate=1 MHz",), "sensor.channel must be given with sensor.pixel = a"),
        (("sensor.asynchronous.change=1",), "sensor.asynchronous must be given with"),
        (
            ("sensor.pixel=latched",),
            "sensor.continuous must be given with sensor.pixel = continuous, not with latched",
        ),
        (
            ("sensor.clock=12345.67890123 Hz", "sensor.continuous.shot_noise=false",
             "duration=1 ms"),
            "sensor.clock must be a frequency of fewer digits",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line(
    refused: Callable[..., str], tmp_path: Path, sets: tuple[str, ...], says: str
) -> None:
    flags = [part for s in (*SMALL, *sets) for part in ("--set", s)]
    assert says in refused("run", "step", "--out", tmp_path / "run", *flags)
    assert not (tmp_path / "run").exists()


def test_a_device_is_refused(refused, tmp_path):
    flags = ("--device", "x")
    readout = ("--set", "sensor.pixel=continuous")
    assert refused("run", "step", "--out", tmp_path / "run", *readout, *flags).startswith(
        "--device"
    )


def test_pixels_that_report_nothing_have_their_page(viform, tmp_path):
    words = ("pixel=continuous", "width=12", "height=8", "continuous.measure=1 s")
    sets = [word for each in words for word in ("--set", f"sensor.{each}")]
    code, _, err = viform(
        "run", "star", *sets, "--set", "duration=1 ms", "--out", str(tmp_path / "run")
    )
    assert code == 0, err
    assert "times as many" not in (tmp_path / "run" / "report.html").read_text("utf-8")


def test_too_many_reports_end_with_advice(viform, tmp_path):
    code, out, err = viform(
        "run", "step", "--out", tmp_path / "run", "--set", "sensor.continuous.most_reports=600",
        *[part for s in SMALL for part in ("--set", s)],
    )  # fmt: skip
    assert (code, out) == (2, "")
    last = err.splitlines()[-1]
    assert last.startswith("viform: the reports must be at most 600, not more; shorten duration")
    assert not (tmp_path / "run" / "result.json").exists()


# The commands.


def test_the_command_prints_what_it_found(viform, tmp_path, monkeypatch):
    monkeypatch.setattr("scenarios.run.REPORT", lambda machine, run: [])
    code, out, _ = viform(
        "run", "step", "--out", tmp_path / "run", "--json", "--set", "duration=1 ms",
        *[part for s in SMALL for part in ("--set", s)],
    )  # fmt: skip
    assert code == 0
    assert json.loads(out) == json.loads((tmp_path / "run" / "result.json").read_text())


def test_the_study_is_a_command(viform, refused, monkeypatch, tmp_path):
    from scenarios.studies import continuous as continuous_study

    whole_study, figure = continuous_study.compare, continuous_study.traces_figure
    monkeypatch.setattr(
        continuous_study, "compare", lambda device: whole_study((8, 16), ("step",), device)
    )
    monkeypatch.setattr(continuous_study, "traces_figure", lambda path: figure(path, 64))
    code, out, _ = viform(
        "bench", "continuous", "--device", "numba", "--figure", tmp_path / "a.png"
    )
    assert code == 0 and (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    lines = out.splitlines()
    assert len(lines) == 2 + 6 and lines[2].startswith("| `step` | spikes, TFP | ")
    code, out, _ = viform("bench", "continuous", "--json", "--device", "numba")
    rows = json.loads(out)["rows"]
    for line, row in zip(lines[2:], rows, strict=True):
        assert f"| {row['sensor']} | {row['reports']:.0f} | {row['bits']:.0f} | " in line
    assert refused("bench", "continuous", "--figure", "a.jpg").startswith("--figure must be a name")
