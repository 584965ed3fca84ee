"""A link's plan and its check: units, bounds, pairing, and what is noticed when left out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cosim import InputError
from cosim.compute.opencl import Device
from cosim.plan.planner import SHARE
from cosim.run.progress import QuietProgress
from cosim.run.result import measured_text
from link.air import Scene
from link.air.effects import charge_changes
from link.layout import TRAINING
from link.mode import Mode
from link.plan.check import (
    LinkCheck,
    check_link,
    compare,
    goodput_change,
    left_out_documents,
)
from link.plan.patches import LinkPatches, Variant
from link.plan.plan import (
    Compared,
    LinkSurvey,
    camera_changes,
    half_width,
    survey_link,
    uncertainty,
)
from link.plan.study import LinkStudy
from link.sending import FileTransmission, Transmission
from link.setting import LinkSetting, link_setting
from link.setup.truth import true_timing
from link.theory import clopper_pearson
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import linked, load
from sensor.device.pattern import DevicePattern

MODE = Mode(128, 128, 2, 2, "8b10b", 32)
SMALL = ["sensor.chip=spikeone", "link.panel.width=128", "link.panel.height=128"]


def small(*more: str) -> LinkSetting:
    """A panel of 128 x 128 before SpikeOne."""
    scenario = linked(load("light-link", [*SMALL, *more])[1], "test")
    return link_setting(scenario, camera_setting(scenario))


@pytest.fixture(scope="module")
def setting() -> LinkSetting:
    return small()


@pytest.fixture(scope="module")
def sent() -> Transmission:
    data = np.random.default_rng(1).bytes(900)
    return FileTransmission(MODE, data, "a.bin", overhead=0.0)


@pytest.fixture(scope="module")
def seen(setting: LinkSetting, sent: Transmission) -> LinkSurvey:
    return survey_link(setting, MODE, sent.symbols, 200)


def test_the_unit_is_half_the_interval_of_the_runs_rate() -> None:
    # Of no errors in n bits: 1 - (alpha / 2)^(1 / n).
    assert half_width(0.0, 10**6) == pytest.approx((1 - 0.0005 ** (1 / 10**6)) / 2, rel=1e-9)
    # Of very many it is z sqrt(p (1 - p) / n), z of 99.9 % being 3.2905.
    assert half_width(0.1, 10**8) == pytest.approx(3.2905 * math.sqrt(0.09 / 1e8), rel=1e-3)


def test_two_ways_are_compared_by_the_bits_that_only_one_has_wrong() -> None:
    full, run = np.zeros((40, 500), np.bool_), np.zeros((40, 500), np.bool_)
    full.ravel()[:100] = True
    run.ravel()[90:350] = True  # 90 are mended, 250 are broken
    found = compare(full, run, 10**6)
    unit = half_width(100 / 20_000, 10**6)
    assert (found.bits, found.full, found.run) == (20_000, 100, 260)
    assert found.error.value == pytest.approx(160 / 20_000 / unit)
    up, down = clopper_pearson(250, 20_000, 0.9995), clopper_pearson(90, 20_000, 0.9995)
    assert found.error.low == pytest.approx((up[0] - down[1]) / unit) and found.error.low > 0
    assert found.error.high == pytest.approx((up[1] - down[0]) / unit)
    assert compare(run, full, 10**6).error.low > 0  # whichever way it goes
    same = compare(full, full, 10**6)
    assert same.error.value == same.error.low == 0 and same.error.high > 0
    few, many = (compare(np.zeros(n, bool), np.zeros(n, bool), 10**6) for n in (10**3, 10**5))
    assert few.error.high > 90 * many.error.high


def test_what_is_decided_otherwise_is_counted_and_the_unit_is_the_runs() -> None:
    full = np.zeros((40, 500), np.bool_)
    none = compare(full, full, 10**6)
    # No event in n trials: at 99.9 % p is below 1 - 0.001^(1 / n), one-sided.
    assert none.differing_limit == pytest.approx(1 - 0.001 ** (1 / 20_000), rel=1e-6)
    assert list(none.change) == [0, none.differing_limit]
    run = full.copy()
    run.ravel()[:300] = True
    some = compare(full, run, 10**6)
    assert [some.more, some.fewer] == [300, 0] and some.differing_limit > 300 / 20_000
    met = LinkCheck(some, {"glare": none, "fog": None}, 0.0, 1, 1.0).rescaled(0.1, 10**8)
    assert met.paired is not None and met.paired.change == some.change
    assert met.error(0.0).value == pytest.approx(300 / 20_000 / half_width(0.1, 10**8))
    assert met.measured == {"glare": 0.0, "fog": None}
    assert LinkCheck(some, {}, 0.0, 1, 1.0).rescaled(None, 0).paired == some


def test_the_interval_holds_the_truth_as_often_as_it_says() -> None:
    # Pairs with rates of 0.01 and 0.013 that share most errors: 2000 intervals of 99.9 %.
    rng, missed = np.random.default_rng(5), 0
    bits, unit = 4000, half_width(0.01, 10**6)
    for _ in range(2000):
        shared = rng.random(bits) < 0.008
        full, run = shared | (rng.random(bits) < 0.002), shared | (rng.random(bits) < 0.005)
        truth = 0.992 * 0.003
        found = compare(full, run, 10**6)
        mine = half_width(full.mean(), 10**6)
        missed += not found.error.low * mine <= truth <= found.error.high * mine
    assert unit > 0 and missed <= 10  # mean at most 2; P(more than 10) < 1e-5


def test_goodput_follows_from_the_codewords_that_come_through() -> None:
    assert goodput_change(1e-6, 1e-6, MODE) == 0
    assert goodput_change(1e-6, 2e-6, MODE) < 1e-12  # both are mended
    assert goodput_change(1e-6, 0.1, MODE) == pytest.approx(1.0)
    assert goodput_change(0.4, 0.4, MODE) == 0


def test_changes_of_a_lit_pixels_charge_are_what_the_sizes_say(seen: LinkSurvey) -> None:
    scene = seen.scene
    camera = replace(
        seen.camera, row_skew=0.25, crosstalk=0.04, dead_time=5e-6, comparator_delay=2.5e-6,
        pattern=DevicePattern(prnu=0.01, dark=4e4, threshold_fpn=0.02, device_seed=1),
    )  # fmt: skip
    made = camera_changes(camera, scene)
    swing = (scene.on - scene.off) / scene.on
    assert made["row-by-row sampling"].size == pytest.approx(0.25 * swing)
    assert made["comparator delay"].size == pytest.approx(0.1 * swing)
    assert made["optical cross-talk"].size == pytest.approx(0.04 * swing)
    assert made["reset dead time"].size == pytest.approx(0.2)
    assert made["dark current and DSNU"].size == pytest.approx(1.0 / scene.on)
    assert made["PRNU"].size == 0.01
    assert scene.cycles / made["PRNU"].duration == pytest.approx(250 * 400)
    assert {e.name for e in camera.acting_effects} - {"random initial charge"} <= set(made)


def test_the_plan_leaves_scintillation_out_and_keeps_what_decides(
    seen: LinkSurvey, device: Device
) -> None:
    plan = seen.plan(0.1, device)
    assert "scintillation" in plan.left_out and plan.tier == "fast"
    assert {"vibration", "lens blur", "row-by-row sampling", "shot noise"} <= set(plan.simulated)
    assert (
        plan.simulated_air == plan.active_air - set(plan.left_out)
        and plan.air_effects == plan.simulated_air
    )
    assert float(plan.plan.total.max()) + plan.tier_bound <= 0.05
    none = np.zeros(1000, np.bool_)
    one = none.copy()
    one[3] = True
    found = compare(none, one, 10**6)
    check = LinkCheck(found, {"scintillation": found}, None, 1, None)
    rows = {row["effect"]: row for row in left_out_documents(plan, check)}
    error = found.error
    assert rows["scintillation"]["measured"] == error.value
    assert rows["scintillation"]["ci"] == (error.low, error.high)
    assert measured_text(rows["scintillation"]).endswith("too few trials to tell whether it holds")
    assert {row["ci"] for row in left_out_documents(plan, None)} == {None}
    assert 0 < rows["scintillation"]["bound"] < 0.05
    # What a closed form that is not the receiver's makes of a bound is no proof.
    kinds = {row.kind for row in plan.plan.rows if row.effect != "random initial charge"}
    assert kinds == {"estimate"} and rows["scintillation"]["kind"] == "estimate"
    everything = seen.plan(0.0, device)
    assert everything.tier == "exact" and not everything.left_out and everything.air_effects is None
    assert everything.camera == seen.camera
    assert seen.plan(0.1, None).tier == "exact"
    assert "scintillation" in seen.plan(0.1, device, forced=["scintillation"]).simulated


def test_strong_turbulence_is_kept(sent: Transmission, device: Device) -> None:
    look = survey_link(small("link.air.structure=1e-9"), MODE, sent.symbols, 200)
    assert "scintillation" in look.plan(0.1, device).simulated


@pytest.mark.parametrize(("structure", "out"), [("1e-14", True), ("1.5e-14", False)])
def test_the_default_link_at_ten_metres_leaves_scintillation_out(structure: str, out: bool) -> None:
    given = ["link.distance=10 m", f"link.air.structure={structure}"]
    scenario = linked(load("light-link", given)[1], "test")
    setting = link_setting(scenario, camera_setting(scenario))
    look = survey_link(setting, Mode(960, 960, 8, 2, "8b10b", 64), 3700, 7400)
    plan = look.plan(0.1, None)
    assert ("scintillation" in plan.left_out) == out
    assert plan.plan.kind == ("estimate" if out else "proof")  # of nothing left out


@pytest.mark.parametrize(("symbols", "out"), [(218, True), (2640, False)])
def test_a_long_file_keeps_what_its_check_cannot_tell(symbols: int, out: bool) -> None:
    """4 and 64 MB at 2 m: the bound of scintillation is far below the tolerance for both, but the
    check compares as few bits for both."""
    scenario = linked(load("light-link", [])[1], "test")
    setting = link_setting(scenario, camera_setting(scenario))
    mode = Mode(960, 960, 2, 1, "scrambled", None, 0.935)
    look = survey_link(setting, mode, symbols, symbols + 13, Compared(4_700_976, 4.5e-4))
    bound = next(e for e in look.air_effects if e.name == "scintillation").bound(look.scene)
    assert bound.value < 1e-3
    assert ("scintillation" in look.plan(0.1, None).left_out) == out


def test_the_spread_of_a_check_is_that_of_spikes_at_the_threshold(seen: LinkSurvey) -> None:
    scene = replace(seen.scene, threshold=1000.0, noise=0.0, bits=10**8)
    size, draws, rng = 2e-3, 400_000, np.random.default_rng(3)
    # Charges at the threshold: those of nearly wrong bits, with and without a factor of the light.
    charge = rng.normal(1000.0, np.sqrt(1000.0), draws)
    moved = (charge < 1000) != (charge * (1 + rng.normal(0.0, size, draws)) < 1000)
    compared = Compared(10**6, 1e-4)
    flips = moved.mean() * 1e-3 * compared.bits
    expected = np.sqrt(flips) / 1e-3 * 1e-4 / compared.bits / half_width(1e-4, scene.bits)
    found = uncertainty(scene, size, 1.0, compared)
    assert found == pytest.approx(expected, rel=4 / 2 / np.sqrt(moved.sum()))
    longer = uncertainty(replace(scene, bits=4 * scene.bits), size, 1.0, compared)
    assert longer == pytest.approx(2 * found)


@pytest.mark.slow
@pytest.mark.parametrize(("distance", "cell"), [("6 m", 4), ("10 m", 8)])
def test_what_scintillation_changes_is_within_its_bound(distance: str, cell: int) -> None:
    """Paired: the same bits and chance of pixels, with and without, in much stronger turbulence and
    three airs. The change of the rate less what the bits that flip do by chance, 4.9 deviations of
    it, is within what the plan counts, twice the estimate; and something is seen to change."""
    given = small(f"link.distance={distance}", "link.air.structure=1e-10")
    data = np.random.default_rng(1).bytes(900)
    sending = FileTransmission(replace(MODE, cell=cell), data, "a.bin", overhead=0.0)
    changes = charge_changes(
        Scene(given.panel, given.optics, given.aim, given.air), given.camera
    )  # fmt: skip
    kept = frozenset(changes) - {"scintillation"}
    seen = []
    for seed in (1, 2, 3):
        one = replace(given, air=replace(given.air, seed=seed))
        patches = LinkPatches(one, sending, 1)
        cycles = (TRAINING + patches.symbols) * MODE.ticks
        scene = survey_link(one, sending.mode, sending.symbols, cycles).scene
        bound = changes["scintillation"].units(replace(scene, bits=patches.bits))
        found = patches.film(
            {"with": Variant("exact", one.camera), "out": Variant("exact", one.camera, kept)},
            None, QuietProgress(),
        )  # fmt: skip
        pair = compare(found["with"].wrong, found["out"].wrong, patches.bits)
        chance = math.sqrt(pair.more + pair.fewer) / pair.bits / pair.unit
        assert pair.counted.value <= 2 * bound + 4.9 * chance
        seen.append((pair.fewer - pair.more) / pair.bits / pair.unit / chance)
    assert max(seen) > 2


@pytest.mark.slow
def test_all_ways_agree_but_the_one_that_leaves_out_what_matters(
    setting: LinkSetting, sent: Transmission, seen: LinkSurvey, device: Device
) -> None:
    patches = LinkPatches(setting, sent, 1)
    assert patches.plane is not None and patches.bits > 3000
    chip = setting.camera.chip
    rows = patches.plane.numbers // chip.width
    assert rows.max() < chip.height and len(np.unique(patches.cells)) == len(patches.cells)
    skewless = setting.camera.without(["row-by-row sampling"])
    found = patches.film(
        {
            "reference": Variant("reference", setting.camera),
            "exact": Variant("exact", setting.camera),
            "fast": Variant("fast", setting.camera),
            "wrong": Variant("exact", skewless),
        },
        device, QuietProgress(),
    )  # fmt: skip
    full, bits = found["reference"], seen.scene.bits
    assert full.rate < 0.05 and full.wrong.shape == (patches.symbols, len(patches.cells))
    assert full.air_ns > 0 and full.camera_ns > 0
    assert full.wrong.sum() == (full.lead < 0).sum() + ((full.lead == 0) & full.wrong).sum()
    for name in ("exact", "fast"):
        assert compare(full.wrong, found[name].wrong, bits).error.low == 0
        assert (full.wrong != found[name].wrong).mean() < 1e-3
    wrong = compare(full.wrong, found["wrong"].wrong, bits)
    assert wrong.error.low > 1
    assert LinkCheck(wrong, {}, 0.0, 1, 1.0).beyond(1.0)


def test_the_check_measures_what_is_left_out(
    setting: LinkSetting, sent: Transmission, seen: LinkSurvey, device: Device
) -> None:
    plan = seen.plan(0.1, device)
    found = check_link(setting, sent, plan, seed=1, device=device, progress=QuietProgress())
    assert set(found.measured) == set(plan.left_out)
    assert all(value is not None and value >= 0 for value in found.measured.values())
    error = found.error(plan.promised)
    assert error.value is not None and error.ci is not None
    assert error.ci[0] <= error.value <= error.ci[1]
    # The limit holds beyond the patches: it is at least the bound of what the plan leaves out.
    assert found.paired is not None and plan.promised > 0
    assert error.ci[1] >= max(found.paired.error.high, plan.promised / found.paired.unit)
    assert not found.beyond(plan.plan.tolerance)
    assert found.document()["patches"] == found.patches > 5


def test_a_panel_out_of_view_has_nothing_to_compare(sent: Transmission, device: Device) -> None:
    away = small("link.aim.offset_x=5000")
    plan = survey_link(away, MODE, sent.symbols, 200).plan(0.1, device)
    found = check_link(away, sent, plan, seed=1, device=device, progress=QuietProgress())
    assert found.paired is None and not found.beyond(0.1)
    assert found.error(plan.promised).value is None
    assert found.measured == dict.fromkeys(plan.left_out)


def test_true_timing_is_where_rows_meet_the_symbols(setting: LinkSetting) -> None:
    height, clock = setting.camera.chip.height, setting.camera.clock
    late = np.linspace(0, clock.edge(1), height).round().astype(np.int64)
    timing = true_timing(setting, late, 2)
    # Rows that are sampled as late as their light comes see all symbols begin at one tick.
    assert timing.slope == pytest.approx(0.0, abs=0.01)
    assert timing.first == pytest.approx(setting.first_light / clock.edge(1), abs=0.01)
    still = true_timing(setting, np.zeros(height, np.int64), 2)
    assert still.slope == pytest.approx(-setting.camera.row_skew, rel=1e-6)


def test_plan_says_what_is_left_out_and_accuracy_refuses_what_it_cannot_see() -> None:
    given = linked(
        load("light-link", [*SMALL, "link.size=900", "link.modem.cell=2", "link.modem.ticks=2",
                            "link.modem.line=8b10b", "link.modem.parity=32",
                            "sensor.crosstalk=0"])[1], "test",
    )  # fmt: skip
    document = LinkStudy("small", given, camera_setting(given), None).forecast(QuietProgress())
    assert document["tier"] == "fast" and document["mode"]["line"] == "8b10b"
    assert "scintillation" in {row["effect"] for row in document["left_out"]}
    assert 0 < document["promised"] <= SHARE * document["tolerance"]
    predicted = document["predicted"]
    assert predicted["full_physics_s"] > 0
    # Only light's effects are left out: the camera is the same, and costs the same.
    assert predicted["everything_s"] == predicted["sensor_s"] > 0
    aim = given.link.aim.model_copy(update={"offset_x": 5000.0})
    away = given.model_copy(update={"link": given.link.model_copy(update={"aim": aim})})
    with pytest.raises(InputError, match="whose panel is in view"):
        LinkStudy("away", away, camera_setting(away), None).ladder(QuietProgress())
