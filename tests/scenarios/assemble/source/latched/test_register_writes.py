"""[[sensor.writes]]: the keys, the plan, the images, and runs with and without a board."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Block, Clock, Viform
from cosim.config.toml import to_toml
from cosim.files import open_stream
from cosim.run.machine import Options
from cosim.run.result import Result
from cosim.run.shown import SilentProgress
from cosim.spikes.viform import count_spikes
from rtl_model.stand_in import written_levels
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched.setup import CameraSetup, set_up_camera
from scenarios.run import run_scenario
from sensor.latched.levels import fast_can_follow, planned_effects, widening
from sensor.latched.writes import Registers, Write, phases_of
from sensor.reconstruct.shots import take_shots

SMALL = (
    "sensor.width=48", "sensor.height=40", "duration=4 ms", "scene.at=0 s", "scene.after=1",
    "image.window=21", "sensor.lens.white_rate=0.2",
)  # fmt: skip
HALF = '{"cycle":60,"threshold_level":8}'
WINDOW = '{"at":"2.01 ms","window":[8,32]}'
BACK = '{"cycle":120,"threshold_level":12,"window":[0,40]}'


def setup(*writes: str, device: str | None = "numba", more: tuple[str, ...] = ()) -> CameraSetup:
    sets = [*SMALL, *more, f"sensor.writes=[{','.join(writes)}]"]
    return set_up_camera(load("step", sets)[1], device)  # type: ignore[arg-type]


def filmed(
    folder: Path, *writes: str, more: tuple[str, ...] = (), device: str = "numba"
) -> tuple[Result, Any]:
    sets = [*SMALL, *more, f"sensor.writes=[{','.join(writes)}]"]
    name, scenario = load("step", sets)
    done = run_scenario(
        name, scenario, folder, options=Options(device), progress=SilentProgress(), began=0.0,
        report=lambda machine, run: [],
    )  # fmt: skip
    return done.result, open_stream(done.folder)


def test_writes_land_on_their_cycles() -> None:
    found = setup(HALF, WINDOW, BACK).setting
    # 2.01 ms is 80.4 cycles: the first cycle that begins then is 81. Levels are of the threshold.
    assert [(p.start, p.threshold, p.window) for p in found.phases] == [
        (0, 1000, (0, 40)), (60, 500, (0, 40)), (81, 500, (8, 32)), (120, 750, (0, 40)),
    ]  # fmt: skip
    assert setup('{"at":"2 ms","threshold_level":8}').setting.phases[1].start == 80
    scenario = load("step", [*SMALL, f"sensor.writes=[{HALF},{WINDOW}]"])[1]
    assert to_toml(scenario).count("[[sensor.writes]]") == 2


@pytest.mark.parametrize(
    ("writes", "more", "said"),
    [
        ('{"cycle":5}', (), "sensor.writes[0] must be one of threshold_level and window"),
        ('{"threshold_level":5}', (), "must be given with at or with cycle, not neither"),
        ('{"cycle":5,"at":"1 ms","window":[0,9]}', (), "with at or with cycle, not both"),
        ('{"cycle":5,"threshold_level":17}', (), "threshold_level must be at most 16"),
        ('{"cycle":5,"window":[9,9]}', (), "window must be rows [first, stop) within 0 to 40"),
        ('{"cycle":5,"window":[0,41]}', (), "window must be rows [first, stop) within 0 to 40"),
        ('{"cycle":5,"clock":"20 kHz"}', (), "cycles are numbered by one clock"),
        (f"{HALF},{HALF}", (), "sensor.writes[1] must be after cycle 60"),
        ('{"cycle":160,"threshold_level":8}', (), "at cycles below 160, the end of the run"),
        (HALF, ("sensor.pixel=asynchronous",), "empty unless sensor.pixel = latched"),
        (HALF, ("sensor.circuit.capacitance=10 fF",), "sensor.circuit must be absent with"),
        (HALF, ("sensor.dark_limit=1 ms",), "sensor.dark_limit must be absent with"),
        ('{"cycle":5,"threshold_level":1}', ("sensor.threshold=10 e",),
         "threshold is at least 1 e"),
        ('{"cycle":5,"threshold_level":1}', ("sensor.threshold_noise=100 e",),
         "sensor.threshold_noise must be at most the threshold, 62.5 e"),
    ],
)  # fmt: skip
def test_writes_that_cannot_be_made_are_one_line(refused, tmp_path, writes, more, said) -> None:
    sets = [*SMALL, *more, f"sensor.writes=[{writes}]"]
    words = [word for each in sets for word in ("--set", each)]
    assert said in refused("run", "step", *words, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_link_writes_no_registers(refused) -> None:
    assert "sensor.writes must be empty in a link" in refused(
        "run", "light-link", "--set", f"sensor.writes=[{HALF}]"
    )


def test_bounds_are_sums_over_the_levels(device) -> None:
    plain, written = setup(), setup(HALF, BACK)
    scene = plain.survey.scene
    spans = [(0, 20), (70, 91)]
    assert widening(written.setting, spans) == 1
    assert widening(plain.setting, [(50, 71)]) == 1
    # 10 cycles at 1 spike, 11 at 2: the faster level over the mean.
    assert widening(written.setting, [(50, 71)]) == pytest.approx(2 / ((10 + 2 * 11) / 21))
    # A row that is read in 11 of 21 cycles.
    assert widening(setup('{"cycle":60,"window":[8,32]}').setting, [(39, 60)]) == 1
    part = setup('{"cycle":60,"window":[8,32]}').setting
    assert widening(part, [(50, 71)]) == pytest.approx(21 / 10)
    for one, many in zip(
        planned_effects(plain.setting, spans), planned_effects(written.setting, spans), strict=True
    ):
        levels = [each.acting_effects for each in written.setting.levels]
        assert one.name == many.name and len(levels) == 3
        assert (many.bound(scene).value >= one.bound(scene).value).all()
    noise = written.setting.levels[1].spread / plain.setting.spread
    assert noise == pytest.approx(2**0.5)


@pytest.mark.parametrize(
    ("writes", "more", "tier"),
    [
        ((HALF,), (), "fast"), ((WINDOW,), ("sensor.dead_time=1 us",), "fast"),
        ((HALF,), ("sensor.dead_time=1 us",), "exact"), ((HALF,), ("sensor.reset=hard",), "exact"),
        ((HALF,), ("sensor.lens.white_rate=0.6",), "exact"),
        ((HALF,), ("sensor.reset=subtract",), "fast"),
    ],
)  # fmt: skip
def test_the_exact_tier_runs_where_the_fast_one_has_no_bound(writes, more, tier) -> None:
    made = setup(*writes, device=None, more=("tolerance=0.05", *more))
    plan = made.plan(0.05)
    assert plan.tier == tier
    assert fast_can_follow(made.setting, made.survey.scene) == (tier == "fast")
    assert bool(plan.notes) == (tier == "exact")


@pytest.mark.parametrize("device", ["numba", pytest.param(None, marks=pytest.mark.slow)])
def test_a_run_is_scaled_by_the_level_in_force(tmp_path, device) -> None:
    more = ("image.at=[30, 72, 95, 140]", "tolerance=0.01")
    result, stream = filmed(tmp_path / "a", HALF, WINDOW, BACK, more=more, device=device)
    plain, before = filmed(tmp_path / "b", more=more, device=device)
    assert (result.outcome, plain.outcome) == ("ok", "ok")
    assert result.error.value is not None and result.error.value < 0.01

    def rate(which: Any, first: int, stop: int, rows: slice) -> float:
        return float(count_spikes(which, first, stop)[rows].mean() / (stop - first))

    inside = slice(8, 32)
    same = rate(before, 0, 160, inside)
    assert rate(stream, 0, 60, inside) == rate(before, 0, 60, inside)
    # Half of the pixels store a threshold of the new level and fire in cycle 60 as well, unless
    # their light does it then in any case.
    kept = 0.5 * (1 - 2 * same) / 60
    assert rate(stream, 60, 120, inside) == pytest.approx(2 * same + kept, rel=0.005)
    assert rate(stream, 81, 120, slice(0, 8)) == 0
    # From 500 to 750 e the charge, half a threshold on average, becomes a third.
    less = (1 / 2 - 1 / 3) / 40
    assert rate(stream, 120, 160, inside) == pytest.approx(16 / 12 * same - less, rel=0.01)
    # The images agree with the truth about as well as without writes; with one scale, at 10 dB.
    for name in ("tfp_psnr", "tfi_psnr"):
        assert result.metrics[name].value > plain.metrics[name].value - 5
    for cycle in (30, 72, 95, 140):
        assert (tmp_path / "a" / "images" / f"tfp-{cycle:05d}.png").exists()


def test_a_run_that_was_interrupted_goes_on_across_a_write(tmp_path, monkeypatch) -> None:
    from scenarios.assemble.source.latched.machine import assemble_latched

    sets = [*SMALL, "tolerance=0.01", f"sensor.writes=[{HALF},{WINDOW},{BACK}]"]
    _, scenario = load("step", sets)
    machine = assemble_latched("step", scenario, Options("numba"))  # type: ignore[arg-type]
    source, lens = machine.setup.stages(machine.setup.source()).values()
    check, camera = machine.plan_check, machine.camera
    assert check is not None

    def run(parts: list[tuple[int, int]], stages: list[Any]) -> list[np.ndarray]:
        words = []
        for first, stop in parts:
            block = Block(first, stop - first)
            light = lens.step(source.step(None, block), block)
            for stage in stages[:-1]:
                stage.step(light, block)
            words.append(stages[-1].step(light, block).planes())
        return words

    whole = run([(0, 64), (64, 128), (128, 160)], [check, camera])
    again = assemble_latched("step", scenario, Options("numba"))  # type: ignore[arg-type]
    assert again.plan_check is not None
    first = run([(0, 64)], [again.plan_check, again.camera])
    third = assemble_latched("step", scenario, Options("numba"))  # type: ignore[arg-type]
    assert third.plan_check is not None
    third.plan_check.restore(again.plan_check.state())
    third.camera.restore(again.camera.state())  # type: ignore[union-attr]
    rest = run([(64, 128), (128, 160)], [third.plan_check, third.camera])
    np.testing.assert_array_equal(np.concatenate(first + rest), np.concatenate(whole))
    assert third.plan_check.patches_error() == check.patches_error()


def test_levels_of_a_board_have_the_ratios() -> None:
    assert written_levels(0.2, [1.0, 0.5]) == [3, 1]  # 1023 e x 0.2 = 204.6 of 255 e
    assert written_levels(0.2, [1.0, 2.0, 0.25]) == [3, 7, 0]
    assert written_levels(0.6, [1.0, 0.5]) is None  # 511 e would need 306 e a tick
    assert written_levels(0.6, [1.0, 12.0]) == [0, 11]


def test_a_board_is_written_at_the_same_cycles(tmp_path, viform) -> None:
    sets = [
        "sensor.source=serial:virtual", "duration=2 ms", "scene.at=0 s", "image.at=[30]",
        "image.window=9", "sensor.lens.white_rate=0.2",
        'sensor.writes=[{"cycle":20,"threshold_level":8},{"cycle":40,"window":[4,30]},'
        '{"cycle":60,"threshold_level":16,"window":[0,32]}]',
    ]  # fmt: skip
    name, scenario = load("step", sets)
    done = run_scenario(
        name, scenario, tmp_path / "run", options=Options("numba"), progress=SilentProgress(),
        began=0.0, report=lambda machine, run: [],
    )  # fmt: skip
    metric = {key: each.value for key, each in done.result.metrics.items()}
    assert metric["board_bits_wrong"] == 0
    stream = open_stream(done.folder)
    counts = [count_spikes(stream, a, b) for a, b in ((0, 20), (20, 40), (40, 60), (60, 80))]
    assert not counts[2][:4].any() and not counts[2][30:].any() and counts[3][:4].any()
    # Bars of 1/8 to 8/8 of 0.9 x 0.2 spikes, at 1023, 511 and 1023 electrons.
    bar = 0.9 * 0.2 * (np.arange(32) * 8 // 32 + 1) / 8
    for count, factor in zip(counts, (1, 1023 / 511, 1023 / 511, 1), strict=True):
        # One spike by the phase, and one by charge that is kept across the write.
        assert np.abs(count[10] - 20 * bar * factor).max() <= 2 + 20 * 0.5 / 511
    assert Clock(40_000) == stream.clock


def test_the_plan_names_the_writes(viform) -> None:
    words = [w for s in (*SMALL, f"sensor.writes=[{HALF},{WINDOW}]") for w in ("--set", s)]
    answer = viform("plan", "step", *words, "--device", "numba", "--json")
    document = json.loads(answer.out)
    assert [phase["start"] for phase in document["writes"]] == [0, 60, 81]
    assert (
        "from cycle 81: threshold 500 e, rows 8 to 31"
        in viform("plan", "step", *words, "--device", "numba").out
    )


class _Grey:
    def truth(self, ps: int) -> Any:
        return np.full((2, 3), 0.25, np.float32)


def test_images_use_the_intervals_between_writes() -> None:
    """Threshold 1000 e to 500 e at cycle 64, row 1 not read from then on. Pixel 0 fires every 10
    cycles, then every 5; pixel 1 fires at the write alone and soon after, of the charge that it had
    kept; pixel 2 has spikes in each phase, 20 and 10 cycles apart."""
    phases = phases_of([Write(64, 500.0, (0, 1))], 1000.0, 2)
    planes = np.zeros((128, 2, 3), bool)
    planes[[*range(5, 64, 10), *range(64, 128, 5)], 0, 0] = True
    planes[[64, 66], 0, 1] = True
    planes[[9, 29, 49, 64, 74, 84], 0, 2] = True
    planes[3:64:4, 1] = True
    shots = take_shots(
        Viform.from_planes(planes, Clock.from_hz(40_000.0)), _Grey(), [20, 64, 100], 11, 0.1,
        registers=Registers(phases, 1000.0, 2),
    )  # fmt: skip
    assert [shot.tau[0, 0] for shot in shots] == [10, 5, 5]
    assert [shot.tau[0, 1] for shot in shots] == [0, 0, 0]
    assert [shot.tau[0, 2] for shot in shots] == [20, 10, 10]
    # White is .1 spikes a cycle at 1000 e, .2 at 500 e.
    assert [round(shot.tfi[0, 2], 3) for shot in shots] == [0.5, 0.5, 0.5]
    assert shots[0].tfi[1, 0] == 1.0
    assert [shot.tfi[1].max() for shot in shots[1:]] == [0, 0]
