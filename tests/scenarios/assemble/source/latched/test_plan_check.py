"""The check: an error that is measured, and promises that are not kept."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim import Block, Bound, Interrupted
from cosim.compute.opencl import Device
from cosim.plan.error import BrokenPromise
from cosim.plan.paired import compare, windows, worst
from cosim.run.progress import QuietProgress
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched.plan import CameraCheck, plan_run
from scenarios.assemble.source.latched.setup import set_up_camera
from scenarios.report import write_report
from sensor.latched.effects.dead_time import DEAD_TIME
from sensor.latched.effects.fixed_pattern import PRNU
from tests.scenarios.pages import page_of

LIES = {
    "reset dead time": ("sensor.dead_time=2 us", DEAD_TIME),
    "PRNU": ("sensor.pattern.prnu=0.05", PRNU),
}
"""Effects, each with a key that turns it on."""


def plant(monkeypatch: pytest.MonkeyPatch, name: str) -> str:
    """Makes the bound of an effect claim nothing; the key that turns the effect on."""
    key, effect = LIES[name]
    none = Bound(np.float64(1e-9), "proof")
    monkeypatch.setattr(effect, "bound", lambda setting, scene: none, raising=False)
    return key


@pytest.mark.parametrize("name", ["PRNU", pytest.param("reset dead time", marks=pytest.mark.slow)])
def test_a_false_bound_is_caught_named_and_put_back(film, tmp_path, monkeypatch, name):
    key, told = plant(monkeypatch, name), QuietProgress()
    result, folder = film(
        "step", tmp_path / "run", "scene.at=1.26 ms", key, "scene.before=0.5", progress=told,
        report=write_report,
    )  # fmt: skip
    assert name in result.document()["plan"]["kept"]
    assert name not in {row["effect"] for row in result.left_out}
    start = f"the run is repeated with {name} kept: its absence changes up to "
    assert sum(note.startswith(start) for note in told.notes) == 1
    assert result.error.ci[1] <= result.tolerance and result.outcome == "ok"
    page = page_of(folder)
    assert start in page and "<h3>Reinstated effects</h3>" in page and "reinstated</td>" in page
    assert not (folder / "put_back.json").exists()


def test_a_broken_promise_outlives_an_interruption(film, tmp_path, monkeypatch):
    key, folder = plant(monkeypatch, "PRNU"), tmp_path / "run"
    sets = ("step", folder, "scene.at=1.26 ms", key, "scene.before=0.5")

    def stop(machine, run):
        raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        film(*sets, report=stop)
    assert [f["effect"] for f in json.loads((folder / "put_back.json").read_text())] == ["PRNU"]
    stream = {p: p.stat().st_mtime_ns for p in (folder / "stream.zarr").rglob("*")}
    finished = []
    result, _ = film(*sets, resume=True, report=lambda machine, run: finished.append(run) or [])
    assert {p: p.stat().st_mtime_ns for p in (folder / "stream.zarr").rglob("*")} == stream
    assert [f.effect for f in finished[0].reinstated] == ["PRNU"]
    assert "PRNU" in result.kept and result.error.ci[1] <= result.tolerance
    assert not (folder / "put_back.json").exists()


def verifiers(
    device: Device, tolerance: float, *tiles: list[int], sets: tuple[str, ...] = ()
) -> list[CameraCheck]:
    """Checks of one plan on its own tiles and on these more, run to the end."""
    base = ("sensor.chip=spikeone", "duration=2.5 ms", "image.at=[50]", "sensor.dead_time=1 us")
    _, scenario = load("star", [*base, *sets])
    setup = set_up_camera(scenario, None)
    setting, cycles, lens = setup.setting, setup.cycles, setup.lens
    seen = setup.survey
    plan = plan_run(seen, setting, tolerance, setup.spans, device)
    assert plan.plan.left_out
    made = [CameraCheck(plan, setting, list({*plan.patches(1), *more}), device) for more in tiles]
    source, relay = setup.source(), lens.relay(setting.chip.pitch)
    before, after = setting.reach
    for start in range(0, cycles, 64):
        block = Block(start, min(64, cycles - start))
        wide = Block(max(start - before, 0), block.stop + after - max(start - before, 0))
        for one in made:
            one.step(relay(source.step(None, wide)), block)
    return made


def test_a_longer_check_on_more_patches_stays_within_the_tolerance(device):
    few, many = verifiers(device, 0.2, [], list(range(0, 360, 12)))
    own, longer = few.error(), many.error()
    assert len(many.plane.tiles) > 30 > len(few.plane.tiles)
    # The worst of more patches is worse, if anything; both are below what was asked for.
    assert 0 < own.value <= longer.value <= longer.high <= 0.2
    assert own.low <= own.value <= own.high
    # The patches that the plan chose see what there is to see.
    assert longer.value < 2 * own.high
    for name, measured in many.measured().items():
        assert measured <= many._plan.promise[name].max()
    assert few.broken() == many.broken() == []


def test_a_bright_still_scene_without_its_noise_is_within_the_tolerance(device):
    sets = (
        "scene.rotation=0 Hz", "sensor.threshold=100 ke", "scene.illuminance=50 klx",
        "image.window=81", "sensor.dead_time=0 s", "sensor.pattern.prnu=0.01",
    )  # fmt: skip
    (check,) = verifiers(device, 0.02, [], sets=sets)
    assert "shot noise" in check.measured()
    found = check.error()
    assert 1e-4 < found.value <= found.high <= 0.02 and check.broken() == []


def test_limits_hold_for_errors_of_a_known_law():
    """Normal errors of standard deviation 0.01 over a rate of 0.5: RMS 0.02."""
    rng = np.random.default_rng(1)
    truth = np.full((5, 40, 256), 0.5)
    value, low, high = compare(truth + 0.01 * rng.standard_normal(truth.shape), truth, 0.0)
    assert value.mean() == pytest.approx(0.02, rel=0.01)
    assert (low < 0.02).all() and (high > 0.02).all()
    found = worst(truth + 0.01, truth, 0.0)
    assert (found.value, found.low, found.high) == pytest.approx((0.02, 0.02, 0.02))
    # Below the floor an error counts as if the rate were the floor.
    assert worst(truth * 0 + 0.01, truth * 0, 0.1).value == pytest.approx(0.1)


def test_windows_lie_within_the_run():
    assert windows([0, 50, 99], 41, 100) == [(0, 41), (30, 71), (59, 100)]


def test_what_is_broken_is_raised_at_the_window_that_shows_it(device, monkeypatch, tmp_path: Path):
    key = plant(monkeypatch, "PRNU")
    _, scenario = load("step", ["sensor.chip=spikeone", "duration=5 ms", "image.at=[30,150]", key])
    setup = set_up_camera(scenario, None)
    setting, lens = setup.setting, setup.lens
    plan = plan_run(setup.survey, setting, 1e-3, setup.spans, device)
    assert "PRNU" in plan.plan.left_out
    check = CameraCheck(plan, setting, plan.patches(1), device)
    source, relay = setup.source(), lens.relay(setting.chip.pitch)
    with pytest.raises(BrokenPromise) as caught:
        check.step(relay(source.step(None, Block(0, 64))), Block(0, 64))
    (finding,) = caught.value.findings
    assert finding.effect == "PRNU" and finding.tile in check.plane.tiles
    # The RMS over 256 pixels of a gain of spread 0.05, and its upper limit.
    assert 0.04 < finding.measured < 0.08 and finding.promised == 1e-9


@pytest.mark.parametrize("tolerance", ["0", "0.001"])
def test_an_error_that_a_looser_tolerance_refuses_is_not_ok_at_tolerance_0(
    film, tmp_path, tolerance
):
    result, folder = film(
        "wave", tmp_path / "run", "duration=3 ms", "sensor.circuit.bandwidth=100 MHz",
        f"tolerance={tolerance}", report=write_report,
    )  # fmt: skip
    assert result.error.ci[1] > 1e-3 and result.outcome == "degraded"
    assert "it is the limit of the exact tier" in page_of(folder)
