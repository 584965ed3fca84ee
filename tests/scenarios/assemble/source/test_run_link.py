"""A link from end to end: a file crosses and comes whole, or the cause is named and nothing is
handed out."""

from __future__ import annotations

import hashlib
import json
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from cosim import InputError
from cosim.config.amounts import count
from cosim.run.machine import Options
from cosim.run.result import Metric, Result
from cosim.run.shown import SilentProgress
from link.evaluation.reception import judge_delivery
from link.evaluation.record import LinkEvaluation
from link.layout import Layout
from link.mode import Mode
from link.plan.stages import carried
from link.setting import link_setting
from link.setup.modes import choose_mode, tag_warning
from link.setup.setup import set_up_link
from link.verdict import Cause, Verdict
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import load
from scenarios.cli.scenario.run import print_result
from scenarios.report import write_report
from scenarios.run import run_scenario

SMALL = (
    "sensor.chip=spikeone", "link.panel.width=384", "link.panel.height=224", "link.size=20000",
    "link.modem.cell=2", "link.modem.ticks=2", "link.modem.line=8b10b", "link.modem.parity=32",
)  # fmt: skip
"""384 x 224 panel pixels before 400 x 250 camera pixels, in a mode that is known to work."""


def link(out: Path, *assignments, report=lambda machine, run: []):
    name, scenario = load("light-link", [*SMALL, *assignments])
    done = run_scenario(
        name, scenario, out, options=Options(), progress=SilentProgress(),
        began=time.perf_counter(), report=report,
    )  # fmt: skip
    return done.result, json.loads((done.folder / "verdict.json").read_text()), done.folder


@pytest.fixture(scope="module")
def sent(tmp_path_factory):
    """A run with its report; what it left in memory."""
    kept: list[LinkEvaluation] = []

    def report(machine, run):
        kept.append(run.outcome.views)
        return write_report(machine, run)

    folder = tmp_path_factory.mktemp("link")
    file = folder / "a picture.bin"
    file.write_bytes(hashlib.shake_256(b"link").digest(20_000))
    result, verdict, out = link(folder / "run", f"link.file={file}", report=report)
    return result, verdict, out, kept[0], file


def test_a_file_crosses_bit_for_bit(sent):
    result, verdict, folder, _, file = sent
    assert (result.outcome, verdict["cause"], verdict["delivered"]) == ("ok", "none", True)
    assert (folder / "received" / file.name).read_bytes() == file.read_bytes()
    assert [p.name for p in (folder / "received").iterdir()] == [file.name]
    assert all((folder / name).exists() for name in result.files)
    assert json.loads((folder / "result.json").read_text())["files"] == result.files


def test_rates_and_delays_follow_from_their_definitions(sent):
    result, _, _, run, file = sent
    metric = {name: each.value for name, each in result.metrics.items()}
    hz = 40_000 * (1 + 20e-6)
    assert metric["raw_bps"] == pytest.approx(run.layout.cells * hz / 2)
    assert metric["coded_bps"] == pytest.approx(metric["raw_bps"] * 0.8 * 223 / 255)
    seconds = file.stat().st_size * 8 / metric["goodput_bps"]
    last = (run.received.delivered_tick + 1) / 40_000 - run.setting.first_light * 1e-12
    assert seconds == pytest.approx(last)
    assert metric["goodput_bps"] < metric["coded_bps"] < metric["raw_bps"]
    assert metric["raw_bps"] < metric["capacity_bps"] <= 400 * 250 * 40e3
    rows = {row.stage: row for row in result.latency}
    assert list(rows) == ["encoder", "panel", "air", "readout", "decoder"]
    assert rows["air"].median_us == pytest.approx(2 / 299.792458, rel=1e-3)
    # A group is 10 symbols of 2 planes; from its first light to its end at least as long.
    assert rows["encoder"].max_us == pytest.approx(20 / hz * 1e6, rel=1e-6)
    assert metric["latency_us"] >= 20 / hz * 1e6


def test_errors_are_counted_beside_what_was_sent(sent):
    _, _, _, run, _ = sent
    errors = run.errors
    carried = errors.by_cell >= 0
    assert errors.wrong == errors.by_cell[carried].sum() == errors.by_symbol.sum()
    assert errors.bits == errors.symbols * run.layout.cells
    assert carried.sum() == run.layout.cells
    low, high = run.theory.interval
    assert low <= errors.rate <= high
    assert run.theory.closed_interval is not None
    assert run.theory.closed_interval[0] <= run.theory.closed <= run.theory.closed_interval[1]


def test_the_last_symbol_errs_no_more_than_others(sent):
    """Behind it come known cells, not darkness: else nine of its bits err, three of all others."""
    errors = sent[3].errors
    assert errors.by_symbol.size == errors.symbols and errors.wrong <= 8 and errors.at_end <= 1
    mean = errors.wrong / errors.symbols
    assert ((errors.by_symbol - mean) ** 2).sum() / mean < chi2.ppf(0.999, errors.symbols - 1)


def test_the_report_is_one_file_with_every_section(sent):
    _, _, folder, _, _ = sent
    page = (folder / "report.html").read_text()
    for title in ("Received whole", "What the camera saw", "Rates", "The eye", "Which cells fail",
                  "Soft values", "to fill the last group", "From a byte to its arrival",
                  "Rate against distance",
                  "What was kept and what was left out", "Run time"):  # fmt: skip
        assert title in page
    assert "http://" not in page and "https://" not in page
    for name in ("view", "rates", "errors", "eye", "soft", "cells", "latency"):
        assert (folder / "figures" / f"{name}.png").stat().st_size > 1000


def test_the_eye_and_the_overheads_are_told(sent):
    result, _, _, run, _ = sent
    metric = {name: each.value for name, each in result.metrics.items()}
    assert (metric["eye_height"], metric["eye_width"]) == (run.eye.height, run.eye.width)
    assert -1 < run.eye.height < 1 and (run.eye.height > 0 or run.eye.width == 0)
    assert (run.eye.density.sum(axis=0) == run.eye.traces).all()
    assert np.abs(run.eye.sampled).max() <= 0.55  # half a tick, and what the timing is off
    box = run.received
    assert metric["frames_sent"] == (
        metric["frames_needed"] + metric["frames_repair"] + metric["frames_fill"]
    ) and metric["frames_needed"] == box.frames_needed  # fmt: skip
    assert metric["frames_repair"] >= 2  # with fewer the fountain may fail


@pytest.mark.slow
def test_an_empty_file_crosses_as_one(tmp_path):
    file = tmp_path / "nothing.txt"
    file.touch()
    result, verdict, folder = link(tmp_path / "run", f"link.file={file}", report=write_report)
    assert (result.outcome, verdict["delivered"], verdict["bytes"]) == ("ok", True, 0)
    assert (folder / "received" / file.name).read_bytes() == b""
    assert result.metrics["goodput_bps"].value == 0


@pytest.mark.parametrize(
    ("assignment", "cause"),
    [
        ("link.aim.offset_x=240", "out_of_view"),
        ("link.aim.occluded=0.5", "occluded"),
        pytest.param("link.aim.rotation=15 deg", "out_of_view", marks=pytest.mark.slow),
        pytest.param("link.aim.focus=0.3 m", "out_of_focus", marks=pytest.mark.slow),
        pytest.param("link.panel.clock_offset=50000", "wrong_clock", marks=pytest.mark.slow),
        pytest.param("link.air.sun=1e5 lux,link.air.sun_angle=0 deg", "saturated",
                     marks=pytest.mark.slow),
        pytest.param("duration=6 ms,link.size=200000", "too_large", marks=pytest.mark.slow),
        pytest.param("link.distance=8 m", "too_small", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_bad_input_is_a_verdict_that_names_the_cause_and_hands_out_nothing(
    assignment, cause, tmp_path
):
    result, verdict, folder = link(tmp_path / "run", *assignment.split(","))
    assert (result.outcome, verdict["cause"], verdict["delivered"]) == ("failed", cause, False)
    assert not [*(folder / "received").glob("*")]
    assert verdict["told"]
    if cause == "too_small":  # the run knew before
        assert "tags too small" in verdict["told"]
        scenario = load("light-link", [*SMALL, assignment])[1]
        setting = link_setting(scenario, camera_setting(scenario))
        told = tag_warning(setting, Mode(384, 224, 2, 2, "8b10b", 32))
        assert told is not None and "has 0.98 camera pixels and is found from 1.6 on" in told
    # What was neither measured nor foreseen is null, and 0 only what was counted.
    metric = {name: each.value for name, each in result.metrics.items()}
    assert metric["goodput_bps"] is metric["goodput_error"] is None
    unlike = ("out_of_view", "occluded", "wrong_clock")  # closed forms have none of these
    assert (metric["ber_theory"] is None) == (cause in (*unlike, "out_of_focus"))
    assert (metric["capacity_bps"] is None) == (cause in ("out_of_view", "out_of_focus"))
    if cause != "too_large":
        for name in ("ber", "ber_low", "ber_high", "ber_soft", "eye_height", "latency_us",
                     "frames_needed"):  # fmt: skip
            assert metric[name] is None
        assert (metric["bits_compared"], metric["frames_received"]) == (0, 0)
        assert result.latency == []


HOPELESS = ("link.aim.blur=4", "link.modem.parity=auto", "link.size=1000000")


def test_what_no_mode_is_foreseen_to_carry_is_filmed_for_a_short_stretch_alone():
    runs = [
        set_up_link(scenario, camera_setting(scenario), "numba", SilentProgress())
        for more in ([], ["link.modem.parity=128"], ["duration=40 ms"])
        for _, scenario in [load("light-link", [*SMALL, *HOPELESS, *more])]
    ]
    cut, given, timed = runs
    assert cut.choice is not None and not cut.choice.holds
    assert [run.shortened for run in runs] == [True, False, False]
    assert cut.mode == given.mode and given.sent.sent_whole and not cut.sent.sent_whole
    assert 500 < cut.sent.planes <= 600 < timed.sent.planes <= 1600 < given.sent.planes
    seconds = [run.sent.planes / run.setting.panel.clock.hz for run in (cut, given)]
    told = cut.shortened_message()
    assert "no mode is foreseen to work (0." in told and "of a pilot's bits were wrong" in told
    assert (
        f"so only {seconds[0]:.3g} s of the {seconds[1]:.3g} s that the file takes are filmed"
        in told
    )
    # the receiver's cause stands: too little room is not what is wrong
    received = SimpleNamespace(delivered=None, verdict=Verdict(Cause.NOISY, "seen"))
    assert judge_delivery(cut, received) == (Verdict(Cause.NOISY, f"seen; {told}"), False)
    assert judge_delivery(timed, received)[0].cause is Cause.TOO_LARGE
    # What was sent could not have been enough: that comes before what else is wrong.
    some = SimpleNamespace(delivered=None, verdict=Verdict(Cause.TOO_SMALL, "seen"), frames_right=3)
    verdict, _ = judge_delivery(timed, some)
    sent, needed = (timed.sent.outbox.frames_by(timed.sent.groups), timed.sent.outbox.frames_needed)
    assert verdict.cause is Cause.TOO_LARGE
    assert f"room for {sent} frames, and the file's" in verdict.text
    assert (
        f" bytes need {count(needed)}; lengthen duration or leave it out; besides, the panel's "
        in verdict.text
    )
    nothing = SimpleNamespace(**vars(some) | {"frames_right": 0})
    assert judge_delivery(timed, nothing)[0].cause is Cause.TOO_SMALL


def test_what_cannot_arrive_is_filmed_for_a_short_stretch_alone():
    """Without a pilot: the panel is out of view, or its tags are too small."""
    for keys in (["link.aim.offset_x=240"], ["link.distance=20 m"]):
        given = [*SMALL[:3], "link.size=4000000", *keys]
        _, scenario = load("light-link", given)
        run = set_up_link(scenario, camera_setting(scenario), "numba", SilentProgress())
        assert run.choice is None and run.shortened and run.sent.planes <= 600
        assert run.sent.whole * run.mode.ticks > 2000
        assert run.shortened_message().startswith("no mode is foreseen to work, so only ")
        received = SimpleNamespace(delivered=None, verdict=Verdict(Cause.OUT_OF_VIEW, "seen"))
        assert judge_delivery(run, received)[0].cause is Cause.OUT_OF_VIEW


def test_a_panel_whose_tags_are_too_small_is_filmed_for_a_short_stretch_alone():
    """At 14 m the pilots, which need no tags, find a mode that holds, but no receiver finds the
    panel: the plan says so too."""
    given = ["link.size=1000000", "link.distance=14 m", "sensor.clock_steering=false"]
    _, scenario = load("light-link", given)
    run = set_up_link(scenario, camera_setting(scenario), "numba", SilentProgress())
    assert run.choice is not None and run.choice.holds
    assert carried(run).goodput is None
    assert run.shortened and run.sent.planes <= 600 < run.sent.whole * run.mode.ticks
    told, small = run.warnings()
    assert small.startswith("tags too small")
    assert told.startswith("the tags are foreseen to be too small, so only ")


def test_the_verdict_is_printed_first_and_the_unknown_in_one_line(capsys):
    metrics = {"ber": Metric(None, "1"), "raw_bps": Metric(5.0, "bit/s"), "fer": Metric(None, "1")}
    left_out = [
        {"effect": "a", "bound": 0.5, "kind": "proof", "measured": 0.25},
        {"effect": "b", "bound": 0.5, "kind": "estimate", "measured": None},
    ]
    result = Result(
        "light-link", "failed", 1, "none", 0.5, 0.1, run_time_s=2.0, metrics=metrics,
        left_out=left_out,
    )  # fmt: skip
    print_result(result, Path("runs"), [], ["the panel is out of view: aim"], False)
    assert [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()] == [
        "outcome failed", "verdict the panel is out of view: aim", "raw_bps 5 bit/s",
        "unknown ber, fer", "error unknown",
        "left out a: bound 0.5 (proof), 0.25 measured",
        "b: bound 0.5 (estimate), not measured",
        "run time 2 s for 500 ms of light", f"report {Path('runs') / 'report.html'}",
    ]  # fmt: skip
    print_result(result, Path("runs"), [], [], False)
    said = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert said[:3] == ["ber unknown", "raw_bps 5 bit/s", "fer unknown"]
    assert said[-2] == "outcome failed"


@pytest.mark.parametrize(
    ("assignments", "said"),
    [
        (["link.file=nosuch.bin"], "link.file must be a file that can be read"),
        (["link.file=."], "link.file must be a file that can be read"),
        (["link.panel.width=200"], "link.panel.width must be a multiple of 32, not"),
        (["sensor.pixel=continuous"], "sensor.pixel must be latched in a link"),
        (["sensor.lens.f_number=2"], "sensor.lens.f_number must be absent in a link"),
        (["duration=1 ms"], "duration must be at least"),
        (["link.distance=0.05 m"], ""),
        (["link.distance=120 m"], "link.distance must be at most "),
    ],
)  # fmt: skip
def test_what_cannot_be_run_is_refused_before_anything_is_written(assignments, said, tmp_path):
    with pytest.raises(InputError) as caught:
        link(tmp_path / "run", *assignments)
    assert str(caught.value).startswith(said)
    assert not (tmp_path / "run").exists()


def test_scene_and_link_together_and_commands_of_the_other_kind_are_refused(refused):
    said = refused("run", "light-link", "--set", "scene.kind=star", "--set", "link.file=a")
    assert said.startswith("duration must be given, not absent")  # with a scene it is a camera's
    assert refused("live", "light-link").startswith("the scenario must be one with a [scene]")


@pytest.mark.slow
def test_four_megabytes_cross_two_metres_at_a_gigabit(tmp_path):
    name, scenario = load("light-link")
    done = run_scenario(
        name, scenario, tmp_path / "run", options=Options(), progress=SilentProgress(),
        began=time.perf_counter(),
    )  # fmt: skip
    result = done.result
    assert result.outcome == "ok"
    assert result.metrics["goodput_bps"].value >= 1e9
    assert (done.folder / "received" / "random.bin").stat().st_size == 4_000_000
    assert "scintillation" in [row["effect"] for row in result.left_out]


def test_a_panel_out_of_view_is_not_filmed_for_long():
    """4 MB take less than 0.1 s of light, not the 3 s of the surest mode."""
    _, scenario = load("light-link", ["link.aim.offset_x=600"])
    mode, choice = choose_mode(
        scenario.link.modem, link_setting(scenario, camera_setting(scenario)), 4_000_000, None,
        SilentProgress(),
    )  # fmt: skip
    assert choice is None
    rate = 8 * Layout(mode).group_bytes(1) / (Layout(mode).group * mode.ticks) * 40_000
    assert 8 * 4_000_000 / rate < 0.1
