"""The asynchronous readout's plan and error: what is promised is held, and a false promise is found
out and named."""

from __future__ import annotations

import json
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import InputError
from cosim.run.machine import Options, Run
from cosim.run.result import Result
from cosim.run.shown import SilentProgress
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.asynchronous import study_asynchronous
from scenarios.run import run_scenario
from sensor.asynchronous import study
from sensor.asynchronous.plan import effects
from sensor.asynchronous.plan.check import check_events, measure, tiles_of
from sensor.asynchronous.run import EventRun, EventStart
from sensor.asynchronous.study import TOLERANCES, measure_ladder

SMALL = ("sensor.asynchronous.width=96", "sensor.asynchronous.height=96")


def sky(*sets: str) -> Scenario:
    return load("sun-and-stars", [*SMALL, *sets])[1]


def begin(scenario: Scenario) -> EventStart:
    return study_asynchronous("sun-and-stars", scenario).start


def rows_of(scenario: Scenario) -> list[dict[str, Any]]:
    found = study_asynchronous("sun-and-stars", scenario).forecast(SilentProgress())
    assert json.dumps(found, allow_nan=False)
    return list(found["rows"])


def shoot(out: Path, *sets: str) -> tuple[Result, EventRun]:
    runs: list[EventRun] = []

    def keep(machine: Any, run: Run) -> list[str]:
        runs.append(machine.judged(run))
        return []

    done = run_scenario(
        "sun-and-stars", sky(*sets), out, options=Options(), progress=SilentProgress(),
        began=time.perf_counter(), report=keep,
    )  # fmt: skip
    return done.result, runs[0]


def test_a_run_says_its_error_and_what_it_left_out(tmp_path):
    _, run = shoot(tmp_path / "run")
    document = json.loads((tmp_path / "run" / "result.json").read_text())
    error = document["error"]
    assert error["tolerance"] == 1e-3 and error["kind"] == "rate of first reports, worst tile"
    assert error["ci"][0] <= error["value"] <= error["ci"][1] <= 1e-3
    rows = {row["effect"]: row for row in document["plan"]["left_out"]}
    dark = rows["dark current and DSNU"]
    # 5 e/s count in the dark and do not beside the sun's 3e10: kept here, left out there.
    assert "dark current and DSNU" in document["plan"]["kept"]
    assert set(dark) == {"effect", "bound", "kind", "measured"} and dark["kind"] == "proof"
    assert 0.3 * dark["bound"] < dark["measured"] < dark["bound"] <= 5e-4
    # With 300 e shot noise is 6 % of a width.
    assert {"shot noise", "PRNU"} <= set(document["plan"]["kept"]) - set(rows)
    assert any(note.startswith("left out, of all pixels: dark current") for note in run.run.notes)


def test_tolerance_zero_keeps_everything_and_leaves_the_tables_error(tmp_path):
    result, _ = shoot(tmp_path / "run", "tolerance=0", "duration=1 s")
    assert result.left_out == [] and result.error is not None
    assert result.error.value is not None and 0 < result.error.value < 1e-5


def test_the_plan_says_what_each_effect_may_change_and_costs():
    rows = {row["effect"]: row for row in rows_of(sky())}
    assert list(rows) == [
        "shot noise", "PRNU", "dark current and DSNU", "later reports", "shortest width",
        "timing clock", "first-spike rule", "shared channel",
    ]  # fmt: skip
    assert all(0 < row["kept"] <= 1 for row in rows.values())
    assert rows["shot noise"]["kept"] == 1 > rows["dark current and DSNU"]["kept"]
    assert rows["dark current and DSNU"]["bound"] <= 5e-4
    assert rows["later reports"]["kind"] == "estimate"
    assert rows["shot noise"]["cost_ns"] >= 0
    # The sun's widths are ten ticks of a clock.
    assert rows["timing clock"]["bound"] > 0.1
    assert rows["shared channel"]["bound"] == 0
    everything = {row["effect"]: row for row in rows_of(sky("tolerance=1"))}
    assert everything["dark current and DSNU"]["kept"] == 0


def test_bounds_that_are_infinite_are_unknown():
    rows = rows_of(sky("sensor.threshold=1 e", "duration=1 ms"))
    assert {r["effect"]: r["bound"] for r in rows}["shot noise"] is None


REPEATED = "the run is repeated with "
PLANTED = [("shot noise", "_shot_noise"), ("PRNU", "_prnu"), ("dark current and DSNU", "_dark")]


@pytest.mark.parametrize(("name", "function"), PLANTED)
def test_a_false_bound_is_found_out_named_and_put_back(monkeypatch, name, function):
    """The planted bound is a thousandth of the true one."""
    true = getattr(effects, function)
    monkeypatch.setattr(effects, function, lambda scene: true(scene) * 1e-3)
    start = begin(sky("tolerance=1e-2"))
    plan = start.plan(1e-2)
    assert plan.where(name).any()
    checked = check_events(plan, start.view, 1e-2)
    assert not checked.plan.where(name).any()
    assert name not in [row["effect"] for row in checked.left_out]
    assert [text.split(" kept: ")[0] for text in checked.notes] == [REPEATED + name]
    assert checked.error.high <= 1e-2


def test_a_run_with_a_false_bound_says_so_and_keeps_the_effect(tmp_path, monkeypatch):
    monkeypatch.setattr(effects, "_shot_noise", lambda scene: scene.mean * 1e-9)
    result, run = shoot(tmp_path / "run", "duration=100 ms")
    assert "shot noise" in result.kept
    assert "shot noise" not in [row["effect"] for row in result.left_out]
    told = [note for note in run.run.notes if note.startswith(REPEATED + "shot noise kept: ")]
    assert len(told) == 1 and "its absence changes up to" in told[0]
    assert result.error is not None and result.error.ci is not None
    assert result.error.ci[1] <= 1e-3
    # The sun's widths vary as those of 300 electrons do.
    sun = run.views.sent.exact[run.views.recovered[0].target.mask.ravel()[run.views.sent.pixel]]
    assert 0.02 < sun.std() / sun.mean() < 0.08


def test_a_sum_that_exceeds_the_tolerance_is_found_out(monkeypatch):
    """Bounds and single measurements that lie alike: only the reference can tell."""
    monkeypatch.setattr(effects, "_shot_noise", lambda scene: scene.mean * 1e-9)
    monkeypatch.setattr("sensor.asynchronous.plan.check._left_out", lambda *given: ([], []))
    start = begin(sky("duration=1 s"))
    plan = start.plan(1e-3)
    assert plan.where("shot noise").any()
    checked = check_events(plan, start.view, 1e-3)
    assert not checked.plan.left_out.any()
    assert checked.notes[0].endswith(REPEATED + "every effect kept")
    assert checked.error.high < 1e-3


def test_the_tiles_looked_at_are_those_where_most_can_go_wrong():
    start = begin(sky())
    plan = start.plan(1e-2)
    tiles = tiles_of(plan, 1)
    scene = plan.scene
    assert {int(np.argmax(scene.mean)), int(np.argmin(scene.mean))} <= set(tiles)
    assert int(np.argmax(plan.plan.total)) in tiles
    assert tiles == tiles_of(plan, 1)


def test_every_report_is_compared_where_every_spike_is_sent():
    """Moving and steady light without a rule of changes: the engine to its table's error."""
    for name, sets in (
        ("sun-and-stars", [*SMALL, "sensor.asynchronous.change=0", "duration=1 us"]),
        ("step", ["sensor.pixel=asynchronous", "sensor.asynchronous.width=48",
                  "sensor.asynchronous.height=32", "duration=2 ms", "scene.at=0.3 ms"]),
    ):  # fmt: skip
        start = begin(load(name, sets)[1])
        plan = start.plan(0.0)
        assert "later reports" not in {e.name for e in plan.effects}
        found = measure(plan, start.view, list(range(plan.scene.mean.size)))
        assert 1e-9 < found.value < 2e-6


def test_readings_below_threshold_are_compared_by_their_levels():
    start = begin(
        sky("duration=30 ms", "sensor.asynchronous.longest_width=10 ms",
            "sensor.asynchronous.levels=100")
    )  # fmt: skip
    plan = start.plan(0.0)
    found = measure(plan, start.view, list(range(plan.scene.mean.size)))
    assert found.value < 1e-5
    # A reading moves by whole levels, a hundredth each, for a part in a thousand of light.
    for tolerance in (1e-3, 0.05, 1.0):
        plan = start.plan(tolerance)
        assert plan.left_out.any() and check_events(plan, start.view, tolerance).notes == []


def test_the_ladder_of_tolerances(monkeypatch):
    monkeypatch.setattr(study, "_CALLS", 1)
    found = measure_ladder(begin(sky("duration=1 s")), SilentProgress())
    assert json.dumps(found, allow_nan=False)
    rows = [row for row in found["rows"] if row["tier"] == "fast"]
    assert [row["tolerance"] for row in rows] == list(TOLERANCES) and len(rows) >= 6
    errors = [row["error"] for row in rows]
    assert errors[0] > 1e3 * errors[-1] > 0
    for looser, tighter in pairwise(rows):
        assert tighter["error"] <= looser["ci"][1]
        assert tighter["ci"][0] <= tighter["error"] <= tighter["ci"][1]
        assert set(looser["effects"]) <= set(tighter["effects"])
    for row in rows[:-1]:
        assert row["ci"][1] <= row["tolerance"] and row["notes"] == [] and row["failed"] is None
    assert 0.7 < found["order"] < 1.3
    reference = found["rows"][-1]
    assert reference["tier"] == "reference" and reference["error"] < 1e-12
    assert found["floor"]["reference"] == reference["error"] < errors[-1]
    assert found["floor"]["monte_carlo"] == found["weak"]["mean"][2]
    assert abs(found["weak"]["mean"][0]) < 1.5 * found["weak"]["mean"][2]
    # What the whole run would be for the reference: every spike of the sun.
    assert found["reference"]["intervals"] > 1e10


def test_a_row_that_fails_is_shown(monkeypatch):
    def refuse(*given: Any) -> None:
        raise InputError("the events", "at most 5", "more", "send fewer")

    monkeypatch.setattr(study, "_run", refuse)
    monkeypatch.setattr(study, "_weak", lambda *given: None)
    monkeypatch.setattr(study, "TOLERANCES", (1.0, 0.0))
    found = measure_ladder(begin(sky("duration=1 ms")), SilentProgress())
    rows = [row for row in found["rows"] if row["tier"] == "fast"]
    assert len(rows) == 2
    assert all("the events must be at most 5" in row["failed"] for row in rows)
    assert all(row["error"] is row["run_time_s"] is None for row in rows)
    assert found["order"] is None
