"""Error against run time: rows that differ, errors that shrink with the tolerance, the command."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import Any

import pytest

from cosim.plan.study import LADDER, fit_order
from cosim.run.shown import SilentProgress
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched.ladder import accuracy
from scenarios.assemble.source.latched.setup import set_up_camera

STAR = (
    "sensor.width=160", "sensor.height=128", "sensor.preset=silicon", "scene.rotation=0 Hz",
    "duration=5 ms", "image.at=[60, 150]",
)  # fmt: skip


def test_the_order_is_that_of_a_power_law():
    law = [(t, 3 * t**0.7) for t in (1e-4, 1e-3, 1e-2)]
    assert fit_order(law) == pytest.approx(0.7)
    # What has no tolerance, or no more error than tolerance 0 has, does not count.
    assert fit_order([*law, (0.0, 1e-9), (1e-6, 2e-9)], 1e-9) == pytest.approx(0.7)
    assert fit_order(law[:2]) is None


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    _, scenario = load("star", list(STAR))
    return accuracy(set_up_camera(scenario, None), SilentProgress())


def test_every_tolerance_has_a_row_in_every_tier(document):
    rows = document["rows"]
    for tier in ("exact", "fast"):
        mine = [r for r in rows if r["tier"] == tier]
        assert [r["tolerance"] for r in mine] == list(LADDER)
        assert mine[0]["left_out"] == [] and mine[0]["same_as"] is None
        assert set(mine[0]["effects"]) == set(document["reference"]["effects"])
        for r in mine:
            if r["same_as"] is not None:
                first = next(o for o in mine if o["tolerance"] == r["same_as"])
                same = ("error", "effects", "ns_per_pixel_cycle")
                assert all(first[k] == r[k] for k in same) and first["same_as"] is None
    assert len([r for r in rows if r.get("same_as") is None]) >= 6


def test_a_tighter_tolerance_is_never_less_accurate(document):
    """Errors do not grow as the tolerance tightens, within their intervals, and stay below it."""
    for tier in ("exact", "fast"):
        mine = [r for r in document["rows"] if r["tier"] == tier]
        for tight, loose in pairwise(mine):
            assert tight["ci"][0] <= loose["ci"][1]
            assert loose["error"] <= loose["tolerance"] or loose["same_as"] == 0
        assert mine[0]["error"] < 1e-4
        # The exact tier keeps an effect in all tiles if one needs it: that of a hot pixel.
        assert tier == "exact" or mine[-1]["error"] > 1e-4
    assert 0.3 < document["order"] < 2.5


def test_the_command_prints_one_document(viform, monkeypatch, document):
    # The measuring is tested above.
    monkeypatch.setattr("scenarios.assemble.source.latched.study.accuracy", lambda *_: document)
    code, out, _ = viform("accuracy", "star", "--json")
    printed = json.loads(out)
    assert code == 0
    assert {"reference", "order", "rows"} <= set(printed)
    names = {"tier", "tolerance", "error", "ci", "run_time_s", "ns_per_pixel_cycle", "effects"}
    assert all(names <= set(r) for r in printed["rows"])


def test_a_reader_gets_a_table(viform, monkeypatch, document):
    monkeypatch.setattr("scenarios.assemble.source.latched.study.accuracy", lambda *_: document)
    code, out, _ = viform("accuracy", "star")
    assert code == 0 and "speed-up" in out and "shot noise" in out


def test_continuous_pixels_have_a_plan_and_a_ladder(viform):
    """Steady bars of 3000 electrons a time constant and fewer: shot noise is 1.3 % and more."""
    sets = ("sensor.pixel=continuous", "sensor.continuous.width=40", "sensor.continuous.height=16",
            "duration=4 ms", "scene.at=3.9 ms", "scene.before=0.9", "scene.after=0.9")  # fmt: skip
    words = [word for each in sets for word in ("--set", each)]
    planned = viform("plan", "step", *words, "--json")
    assert planned.code == 0, planned.err
    document = json.loads(planned.out)
    assert document["kept"][0] == "shot noise" and document["error"]["of"] == "law"
    assert 0 < document["promised"] < 1e-3 and document["predicted"]["sensor_s"] > 0
    found = viform("accuracy", "step", *words, "--json")
    assert found.code == 0, found.err
    ladder = json.loads(found.out)
    for row in ladder["rows"]:
        assert row["error"] <= row["ci"][1] and row["ns_per_pixel_cycle"] > 0
    exact = next(row for row in ladder["rows"] if row["tolerance"] == 0)
    assert exact["of"] == "law" and exact["left_out"] == [] and exact["error"] < 1e-3
    assert [row["tier"] for row in ladder["rows"]][-1] == "reference"
