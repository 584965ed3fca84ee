"""Rates over distance: the limits follow from geometry, and runs have the predicted rates."""

from __future__ import annotations

import json
import time

import pytest

from cosim.run.machine import Options
from cosim.run.progress import QuietProgress
from link.layout import Layout
from link.prediction.light import cell_scene
from link.receiving.tags import least_module
from link.setting import link_setting
from link.setup import distances
from link.setup.distances import rates_over_distance, span_of
from link.setup.setup import set_up_link
from link.setup.truth import panel_in_view
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import linked, load
from scenarios.run import run_scenario

SMALL = (
    "sensor.chip=spikeone", "link.panel.width=384", "link.panel.height=224", "link.size=40000",
)  # fmt: skip


def scenario(*assignments):
    return linked(load("light-link", [*SMALL, *assignments])[1], "test")


def set_up(*assignments):
    given = scenario(*assignments)
    return set_up_link(given, camera_setting(given), None, QuietProgress())


def test_the_panel_fills_the_view_at_one_end_and_its_tags_are_as_small_as_can_be_at_the_other():
    given = scenario("link.modem.cell=2", "link.modem.ticks=2", "link.modem.line=8b10b",
                     "link.modem.parity=32")  # fmt: skip
    made = set_up_link(given, camera_setting(given), None, QuietProgress())
    near, far = span_of(made.setting, made.mode)

    def at(distance):
        update = {"link": given.link.model_copy(update={"distance": distance * 1e6})}
        return link_setting(given.model_copy(update=update), camera_setting(given))

    assert panel_in_view(at(near * 1.01)) and not panel_in_view(at(near * 0.97))
    module = Layout(made.mode).module
    for distance, found in ((far * 0.999, True), (far * 1.02, False)):
        setting = at(distance)
        assert (setting.scale * module >= least_module(cell_scene(setting).blur)) is found
    assert rates_over_distance(made, QuietProgress()) == []  # the scenario gives the mode


@pytest.mark.slow
def test_runs_have_the_goodput_that_is_predicted_at_their_distances(tmp_path, monkeypatch):
    """The figure of a run at 2 m, and runs at two of its other distances."""
    monkeypatch.setattr(distances, "OTHERS", 4)
    rows = rates_over_distance(set_up(), QuietProgress())
    assert len(rows) >= 4 and all(row.rate for row in rows[:-1])
    for row in [row for row in rows if row.distance != 2.0 and row.rate][:2]:
        name, given = load("light-link", [*SMALL, f"link.distance={row.distance} m"])
        out = tmp_path / f"{row.distance:.3f}"
        done = run_scenario(
            name, given, out, options=Options(), progress=QuietProgress(),
            began=time.perf_counter(), report=lambda machine, run: [],
        )  # fmt: skip
        metrics = json.loads((done.folder / "result.json").read_text())["metrics"]
        assert row.rate / 1.5 < metrics["goodput_bps"]["value"] < row.rate * 1.5
