"""Error of radiance against run time, of a scenario with a display."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from cosim import Block
from cosim.plan.study import LADDER
from cosim.run.shown import SilentProgress
from display.plan.cost import display_ns, golden_ns
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched.ladder import accuracy
from scenarios.assemble.source.latched.setup import set_up_camera
from tests.scenarios.assemble.source.latched.test_display_plan import GLASS, SPANS


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path: Path = tmp_path_factory.mktemp("accuracy") / "glass.toml"
    path.write_text(GLASS)
    sets = ["duration=4.8 ms", "image.at=[128]", "display.renderer=numpy"]
    _, scenario = load(str(path), sets)
    return accuracy(set_up_camera(scenario, None), SilentProgress())


def test_a_tighter_tolerance_is_never_less_accurate(document):
    assert document["error_of"] == "radiance"
    for tier in ("exact", "fast"):
        mine = [r for r in document["rows"] if r["tier"] == tier]
        assert [r["tolerance"] for r in mine] == list(LADDER)
        for tight, loose in pairwise(mine):
            assert tight["ci"][0] <= loose["ci"][1]
            assert set(tight["left_out"]) <= set(loose["left_out"]) or loose["tolerance"] >= 0.1
        last = mine[-1]
        assert last["error"] <= 1.0 and set(SPANS) <= set(last["left_out"])
        assert mine[0]["left_out"] == [] and mine[0]["error"] < last["error"] / 5
        within = [r for r in mine if r["tolerance"] and r["same_as"] != 0]
        assert all(r["error"] <= r["tolerance"] for r in within)


def test_the_reference_has_the_golden_display(document):
    rows = document["rows"]
    best = rows[-1]
    assert best["tier"] == "reference" and set(SPANS) <= set(best["effects"])
    assert best["left_out"] == []
    for row in rows[:-1]:
        assert set(row["effects"]) | set(row["left_out"]) == set(best["effects"])
        assert row["ns_per_pixel_cycle"] < best["ns_per_pixel_cycle"]


def test_the_display_s_cost_counts_planes_and_looks(document):
    """A renderer that does nothing but count is asked for every plane once, in its own spans."""
    import numpy as np

    import display.plan.cost as cost
    from cosim.spikes.viform import words_for
    from display import CameraPlane, DisplaySetting, SpikePanel
    from tests.display.random_streams import CLOCK

    panel = SpikePanel((40, 30), CLOCK, 1.0)
    setting = DisplaySetting(panel, CameraPlane((CLOCK.edge(100),), 10**9), 8)
    shown = [
        (Block(first, 64), np.zeros((words_for(64), 20, 30), np.uint32)) for first in (0, 64, 128)
    ]
    asked: list[tuple[int, int]] = []

    class Counting(cost.GoldenRenderer):
        def step(self, words, cycles, views):  # type: ignore[no-untyped-def]
            asked.append((cycles, views.weight.shape[1]))
            super().step(words, cycles, views)

    assert cost._time(Counting, setting, shown, 300) > 0
    # Two blocks a draw, four times through.
    assert asked == [(128, 16), (64, 8)] * 4
    assert golden_ns(setting, shown) > 0 and display_ns("numpy", setting, shown[:1]) > 0
