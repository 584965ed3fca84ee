"""A display in a run's plan and in its check."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Block, Bound
from cosim.plan.error import BrokenPromise
from display import CameraPlane, DisplaySetting, PursuingEye
from display.effects.bounds import BASE_COST, SPAN_COST
from display.plan.paired import TRUTH
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched.plan import CameraCheck, RunPlan, plan_run
from scenarios.assemble.source.latched.setup import set_up_camera

SPANS = ("planes within 8", "planes within 64")
GLASS = """
title = "A star on a display"
duration = "10 ms"
[scene]
kind = "star"
illuminance = "700 lux"
[sensor]
chip = "spikeone"
clock = "40 kHz"
threshold = "1000 e"
[image]
at = [200, 210]
[display]
"""


@pytest.fixture(scope="module")
def glass(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario with a display."""
    path = tmp_path_factory.mktemp("glass") / "glass.toml"
    path.write_text(GLASS)
    return path


class Made:
    """A scenario looked at."""

    def __init__(self, path: Path, *sets: str) -> None:
        _, self.scenario = load(str(path), list(sets))
        self.setup = setup = set_up_camera(self.scenario, "numba")
        self.setting, self.cycles = setup.setting, setup.cycles
        self.lens, self.white = setup.lens, setup.white_rate
        self.seen = setup.survey
        display = setup.display
        assert display is not None
        self.display = display

    def plan(self, tolerance: float, display: DisplaySetting | None = None, **more: Any) -> RunPlan:
        return plan_run(
            self.seen, self.setting, tolerance, self.setup.spans, None,
            display=display or self.display, **more,
        )  # fmt: skip

    def check(self, plan: RunPlan) -> CameraCheck:
        """Run to its end."""
        check = CameraCheck(plan, self.setting, plan.patches(1), None)
        source, relay = (
            self.setup.source(),
            self.lens.relay(self.setting.chip.pitch),
        )
        for start in range(0, self.cycles, 64):
            block = Block(start, min(64, self.cycles - start))
            check.step(relay(source.step(None, block)), block)
        return check


@cache
def looked(path: Path) -> Made:
    """The same scenario serves all."""
    return Made(path)


def test_only_the_planes_an_observer_resolves_are_rendered(glass):
    """An eye that keeps still lets single planes go; one that pursues fast, or a camera of 100 us,
    keeps them. The coarser spans go only with the finer."""
    made = looked(glass)
    still, observer = made.plan(1e-3), made.display.observer
    assert still.display is not None and still.display.batch == 8
    assert set(SPANS) & set(still.plan.left_out) == {SPANS[0]}
    assert still.full_display == made.display and made.display.batch == 1
    fast = replace(made.display, observer=PursuingEye(observer, (0.0, 4000.0)))
    brief = replace(made.display, observer=CameraPlane(observer.instants, 100_000_000))
    for shown in (fast, brief):
        plan = made.plan(1e-3, shown)
        assert plan.display == shown and not set(SPANS) & set(plan.plan.left_out)
    assert made.plan(0.05).display.batch == 64
    for tolerance in (1e-4, 1e-3, 1e-2, 0.1, 1.0):
        for shown in (made.display, fast, brief):
            out = made.plan(tolerance, shown).plan.left_out
            assert SPANS[1] not in out or SPANS[0] in out
    none = made.plan(0.0)
    assert none.plan.left_out == () and none.display == made.display
    assert made.plan(1e-3, forced=[SPANS[0]]).display.batch == 1


def test_camera_and_display_share_one_tolerance(glass):
    """The sum of the bounds of both stays within half of it, and a pixel-cycle costs both."""
    made = looked(glass)
    for tolerance in (1e-3, 3e-2, 0.3):
        plan = made.plan(tolerance)
        total = sum(plan.plan.promise[n] for n in plan.plan.left_out)
        assert np.all(total + plan.tier_error <= tolerance / 2)
    alone = plan_run(made.seen, made.setting, 0.0, made.setup.spans, None)
    both = made.plan(0.0)
    assert alone.display is None and alone.full_display is None
    assert both.plan.cost_ns - alone.plan.cost_ns == pytest.approx(
        BASE_COST + SPAN_COST[1] + 0.005, rel=1e-9
    )
    # A camera that sees four cycles is no judge of a rate over 41.
    brief = replace(made.display, observer=CameraPlane(made.display.observer.instants, 10**8))
    name = "shot noise"
    seen = plan_run(
        made.seen, made.setting, 0.0, made.setup.spans, None, display=brief, mixed=False
    )
    assert seen.plan.promise[name].max() > both.plan.promise[name].max()


def test_the_check_is_of_radiance_and_its_promises_hold(glass):
    made = looked(glass)
    plan = made.plan(0.03)
    assert plan.display.batch == 64
    check = made.check(plan)
    found, measured = check.error(), check.measured()
    assert 0 < found.value <= found.high <= 0.03
    assert set(measured) == set(plan.plan.left_out) and check.broken() == []
    for name, value in measured.items():
        assert 0 < value <= plan.plan.promise[name].max()
    truth = check.displays.images(TRUTH)
    # White is 1, and the star is neither black nor white all over.
    assert 0.05 < truth.mean() < 1
    told = check.result_error()
    assert told.kind.startswith("radiance as an eye integrates it, measured on ")
    # With everything kept the display is the golden one, and the exact tier's error is left.
    exact = made.check(made.plan(0.0))
    assert exact.error().value < 1e-5


def test_a_false_bound_of_the_display_is_found_at_the_end(glass, monkeypatch):
    made = looked(glass)

    def lie(self):
        true = kept(self)
        none = Bound(np.float64(1e-12), "proof")
        return tuple(replace(e, bound=lambda scene: none) if e.name in SPANS else e for e in true)

    kept = DisplaySetting.acting_effects.fget
    monkeypatch.setattr(DisplaySetting, "acting_effects", property(lie))
    plan = made.plan(1e-3)
    assert plan.display.batch == 64
    with pytest.raises(BrokenPromise) as caught:
        made.check(plan)
    names = {f.effect for f in caught.value.findings}
    assert names == set(SPANS)
    again = made.plan(1e-3, forced=list(names))
    assert again.display.batch == 1


def test_a_run_tells_what_its_display_left_out(glass, film, tmp_path):
    result, folder = film(str(glass), tmp_path / "run", small=False)
    document = json.loads((folder / "result.json").read_text())
    (row,) = [r for r in document["plan"]["left_out"] if r["effect"] == SPANS[0]]
    assert 0 < row["measured"] <= row["bound"] <= result.tolerance / 2
    assert SPANS[1] in document["plan"]["kept"]
    assert result.error.kind.startswith("radiance") and result.error.ci[1] <= result.tolerance


def test_a_plan_says_which_planes_are_rendered(viform, glass):
    sets = ("--device", "numba", "--set", "duration=5 ms", "--set", "image.at=[100]")
    code, out, _ = viform("plan", str(glass), *sets)
    assert code == 0
    assert "planes are rendered at the resolution of the observer: spans of 8" in out
    assert "planes within 8" in out and "of the radiance in the worst tile" in out


def test_a_check_goes_on_from_its_state(glass):
    made = looked(glass)
    plan = made.plan(1e-3)
    source, relay = (
        made.setup.source(),
        made.lens.relay(made.setting.chip.pitch),
    )
    whole, first, second = (
        CameraCheck(plan, made.setting, plan.patches(1), None) for _ in range(3)
    )
    for start in range(0, made.cycles, 64):
        block = Block(start, min(64, made.cycles - start))
        light = relay(source.step(None, block))
        whole.step(light, block)
        if start == 192:
            second.restore(first.state())
        (first if start < 192 else second).step(light, block)
    np.testing.assert_array_equal(whole.displays.images("run"), second.displays.images("run"))
    assert whole.error() == second.error()
