"""Scenarios of the other imagers: what is refused, what is seen, what is foreseen."""

import json
from dataclasses import replace

import numpy as np
import pytest

from cosim import PS, InputError
from cosim.config.amounts import percent
from cosim.config.toml import to_toml
from cosim.light.charts import CHARTS, draw, regions
from cosim.run.machine import Options
from cosim.run.result import Metric
from imagers.adaptive.model import AdaptiveModel, changes
from imagers.catalogue import IMAGERS
from imagers.common.model import measure_frame
from imagers.report.page import metric_text
from imagers.run.check import watched_frames
from scenarios.assemble.machine import assemble, assemble_study
from scenarios.assemble.schema.loading import filmed, linked, load, shipped
from scenarios.assemble.schema.messages import validate
from scenarios.assemble.source.imager import make_view, plan_imager
from scenarios.cli.scenario.plan import _accuracy_text as _text
from scenarios.scenes.kinds.grid import SceneGrid

SHIPPED = ("adaptive-exposure", "ebaps-night", "emccd-window")


def model_of(scenario):
    return IMAGERS[scenario.imager.kind].model(scenario.imager, scenario.duration)


def scenario(kind, scene=None, lens=None, duration="100 ms", **imager):
    data = {
        "title": kind, "duration": duration, "imager": {"kind": kind, **imager},
        "scene": {"kind": "target", "chart": "steps", "illuminance": "100 lux", **(scene or {})},
    }  # fmt: skip
    return validate(data if lens is None else data | {"lens": lens})


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_scenario_reads_back_as_it_was_written(name, tmp_path):
    assert name in shipped()
    _, loaded = load(name)
    path = tmp_path / "scenario.toml"
    path.write_text(to_toml(loaded))
    assert load(str(path))[1] == loaded


@pytest.mark.parametrize(
    ("assignment", "says"),
    [
        ("imager.kind=ccd", "imager.kind must be one of 'adaptive-exposure', 'ebaps', 'emccd'"),
        ("imager.gian=2", "did you mean imager.gain?"),
        ("imager.rows=255", "imager.rows must be"),
        ("imager.high_voltage=-1 V", "imager.high_voltage must be given with imager.kind = ebaps"),
        ("imager.frame_rate=1 s", "imager.frame_rate must be a frequency"),
        ("imager.search=best", "imager.search must be '256th', 'root' or 'half'"),
        ('scene.course=[["2 ms", 1], ["1 ms", 1]]', "scene.course must be knots in order of time"),
        ('scene.course=[["2 ms", -1]]', "scene.course.0.1 must be at least 0"),
        ("scene.course=[]", "scene.course must be"),
        ("scene.chart=moon", "scene.chart must be 'night', 'bars'"),
        ("sensor.clock=1 kHz", "imager must be absent in a scenario with [sensor]"),
        ("board.port=x", "board must be absent in a scenario with a [scene]"),
        ('imager.writes=[["1 ms", "exposure", -1]]', "imager.writes.0.2 must be at least 0"),
        ("lens.f_number=0.1", "lens.f_number must be at least 0.5"),
    ],
)
def test_a_wrong_key_is_refused_in_one_line(assignment, says):
    with pytest.raises(InputError) as caught:
        load("adaptive-exposure", [assignment])
    assert says in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"sync": "external"}, "imager.sync must be internal without pulses or pulse_rate to wait"),
        ({"gain": 10, "gain_step": 3}, "imager.gain must be absent with gain_step, not 10.0"),
        ({"first_row": 500, "rows": 20}, "imager.rows must be a window within its 512 rows"),
        ({"pulses": ["2 ms", "1 ms"]}, "imager.pulses must be in order of time"),
        ({"pulses": ["2 ms"], "pulse_rate": "3 Hz"}, "imager.pulse_rate must be absent with pulse"),
    ],
)
def test_an_emccd_that_cannot_be_is_refused(keys, says):
    with pytest.raises(InputError, match=says):
        scenario("emccd", **keys)


@pytest.mark.parametrize(
    ("kind", "keys", "says"),
    [
        ("ebaps", {"wavelength": "640 nm"},
         "imager.wavelength must be absent with imager.illuminant = lamp, not 640 nm; "
         "write --set imager.illuminant=monochromatic"),
        ("ebaps", {"illuminant": "monochromatic"},
         "imager.wavelength must be given with monochromatic light, not absent; "
         "write --set imager.wavelength='640 nm'"),
        ("ebaps", {"illuminant": "monochromatic", "wavelength": "750 nm", "photocathode": "GaAsP"},
         "imager.wavelength must be below 730 nm, where GaAsP ends, not 750 nm; "
         "lower it, or write --set imager.photocathode=GaAs"),
        ("pwm", {"exposure": "1 ms", "shortest": "2 ms"},
         "imager.shortest must be at most the exposure, 1 ms, not 2 ms; "
         "lower it, or lengthen imager.exposure"),
    ],
)  # fmt: skip
def test_keys_that_do_not_fit_together_are_refused_by_name(kind, keys, says):
    with pytest.raises(InputError) as caught:
        scenario(kind, **keys)
    assert str(caught.value) == says


@pytest.mark.parametrize(
    ("given", "left", "gone"),
    [
        ('imager.pulses=["5 ms"]', "pulses", "pulse_rate"),
        ("imager.gain=40", "gain", "gain_step"),
    ],
)
def test_a_key_that_is_set_goes_before_the_other_of_its_pair(given, left, gone):
    _, loaded = load("emccd-window", [given])
    assert getattr(loaded.imager, left) and getattr(loaded.imager, gone) is None
    with pytest.raises(InputError, match=r"imager\.gain must be absent"):
        load("emccd-window", ["imager.gain=40", "imager.gain_step=3"])


def test_another_kind_of_scene_drops_the_keys_of_the_former():
    _, loaded = load("adaptive-exposure", ["scene.kind=film", "scene.frame_rate=1 kHz"])
    assert loaded.scene.kind == "film" and loaded.scene.illuminance == 200
    with pytest.raises(InputError, match=r"scene\.chart must be"):
        load("adaptive-exposure", ["scene.kind=film", "scene.chart=bars"])
    with pytest.raises(InputError, match=r"scene\.kind must be"):
        load("adaptive-exposure", ["scene.kind=fog"])


@pytest.mark.parametrize(
    ("assignment", "says"),
    [
        ("imager.rows=7", "imager.rows must be a multiple of 2, not '7'"),
        ("scene.course=[]", r"scene.course must be a list of at least 1, not \[\]"),
        ("imager.frame_rate=1 MHz", "write --set imager.frame_rate='100 Hz'"),
    ],
)
def test_a_refusal_says_what_would_do(assignment, says):
    with pytest.raises(InputError, match=says):
        load("adaptive-exposure", [assignment])


def test_sync_pulses_faster_than_any_cycle_are_refused():
    with pytest.raises(InputError, match=r"at most 10000 Hz, .* write --set .*='50 Hz'"):
        load("emccd-window", ["imager.pulse_rate=1 GHz"])


def test_commands_of_a_spike_camera_or_a_link_refuse_an_imager():
    _, loaded = load("emccd-window")
    with pytest.raises(InputError, match="one of a spike camera for `viform live`, not one of ano"):
        filmed(loaded, "live")
    with pytest.raises(InputError, match="not one of another imager"):
        linked(loaded, "link ber")
    with pytest.raises(InputError, match="--device must be numba, or absent"):
        assemble("x", loaded, Options(device="H200"), None)
    with pytest.raises(InputError, match="--device must be numba, or absent"):
        assemble_study("plan", "x", loaded, "H200")
    assemble_study("plan", "x", loaded, "numba")


@pytest.mark.parametrize("kind", ["adaptive-exposure", "ebaps", "emccd"])
def test_a_write_that_the_imager_does_not_take_is_refused_by_its_key(kind):
    """No such register, one that is only read, one bit too many."""
    own = IMAGERS[kind].design().specific
    read_only = next(r.name for r in own if r.mode == "ro")
    wide = next(r for r in own if r.mode == "rw" and r.width < 32)
    for register, value, says in (
        ("speed", 1, "its register one of"),
        ("no such register" * 9, 713_715_000, "its register one of"),
        (read_only, 1, "to be a register that is written"),
        (wide.name, 1 << wide.width, f"it has {wide.width} bits"),
    ):
        given = scenario(kind, writes=[["1 ms", wide.name, 1], ["2 ms", register, value]])
        with pytest.raises(InputError, match=says) as told:
            plan_imager("x", given)
        assert str(told.value).startswith("imager.writes.1 must be a write that the imager takes")
        assert "\n" not in str(told.value) and len(str(told.value)) <= 300


@pytest.mark.parametrize("chart", CHARTS)
def test_a_chart_keeps_its_light_on_any_grid(chart):
    """Coverage of edges: the mean reflectance does not hang on the grid."""
    fine, coarse = draw(chart, (600, 600)), draw(chart, (150, 150))
    assert fine.min() >= 0 and fine.max() <= 1 and fine.std() > 0.05
    assert coarse.mean() == pytest.approx(fine.mean(), abs=2e-3)
    light, dark = regions(fine)
    assert fine[light].mean() - fine[dark].mean() > 0.7 and not (light & dark).any()


def test_the_discs_area_is_the_circles():
    sheet = draw("discs", (900, 900))
    radii = (0.11, 0.07, 0.04, 0.05, 0.02)
    assert sheet.sum() / 900**2 / 0.9 == pytest.approx(np.pi * sum(r * r for r in radii), rel=1e-3)


def test_light_without_a_lens_falls_as_it_is_and_with_one_by_its_gain():
    scene = {"course": [["0 ms", 1], ["10 ms", 1], ["10 ms", 4]]}
    bare = make_view(scenario("ebaps", scene, rows=32, columns=40), (32, 40))
    lensed = scenario("ebaps", scene, lens={"f_number": 1.4}, rows=32, columns=40)
    seen = make_view(lensed, (32, 40))
    assert seen.gain == pytest.approx(0.9 / (4 * 1.4**2))
    assert seen.scenery.lux == pytest.approx(bare.scenery.lux * seen.gain)
    assert bare.most.max() == pytest.approx(360) and bare.least.max() == pytest.approx(90)
    begin = np.zeros(32, np.int64)
    whole = bare.scenery.lux_seconds(0, begin, begin + PS // 50)  # 10 ms of each
    assert whole == pytest.approx(bare.scenery.lux * 0.05)


def test_a_course_is_the_same_as_light_in_pieces():
    """The chart for a spike camera: what its pieces give is the closed form."""
    course = [["2 ms", 1], ["4 ms", 3], ["4 ms", 0.5], ["9 ms", 0]]
    given = scenario("ebaps", {"course": course}, rows=32, columns=40)
    view = make_view(given, (32, 40))
    from cosim import Clock

    light = given.scene.source(SceneGrid((32, 40), Clock(40_000), 400)).step(None, None)
    begin = np.zeros(32, np.int64)
    end = begin + 12 * PS // 1000
    assert light.integral(0, int(end[0])) == pytest.approx(
        view.scenery.lux_seconds(0, begin, end), rel=1e-6
    )


def test_a_moving_scene_is_integrated_row_by_row():
    star = scenario("ebaps", lens={"f_number": 2.0}, rows=32, columns=40)
    data = star.model_dump(mode="json", exclude_none=True)
    data["scene"] = {"kind": "star", "illuminance": "100 lux", "rotation": "20 Hz"}
    view = make_view(validate(data), (32, 40))
    begin = np.arange(32, dtype=np.int64) * (PS // 1000)
    seen = view.scenery.lux_seconds(0, begin, begin + PS // 100)
    alone = [
        view.scenery.lux_seconds(n, begin[n : n + 1], begin[n : n + 1] + PS // 100)[0]
        for n in (0, 15, 31)
    ]
    assert seen[[0, 15, 31]] == pytest.approx(np.stack(alone), rel=1e-6)
    assert view.certain is False and (view.most * 0.01 * (1 + 1e-5) >= seen).all()


def test_what_is_foreseen_holds_what_the_controller_does():
    given = scenario(
        "adaptive-exposure", {"course": [["0 ms", 1], ["250 ms", 1], ["250 ms", 300]]},
        duration="600 ms", rows=16, columns=16,
    )  # fmt: skip
    model = model_of(given)
    ready = plan_imager("x", given)
    imager = model.make()
    frames = imager.film(ready.view.scenery, ready.spec.stop, seed=1, kept=ready.kept)
    taken = [measure_frame(frame) for frame in frames]
    low, high = ready.exposures.seconds
    assert abs(len(taken) - ready.exposures.frames) <= 1
    assert all(low <= t.seconds <= high for t in taken)
    start, jump = changes(taken, ready.view)
    assert start.frames is not None and jump.after == 300 and jump.frames >= 3
    metrics = model.metrics(taken, ready.view, imager)
    assert metrics["frames_to_settle"].value == max(start.frames, jump.frames)
    short = [t for t in taken if t.ready < jump.ps + jump.delay]  # ends before it has settled
    assert model.metrics(short, ready.view, imager)["frames_to_settle"].value is None
    assert metrics["saturated"] == Metric(taken[-1].full, "1")
    assert metrics["saturated_most"] == Metric(max(t.full for t in taken), "1")
    assert metrics["saturated_pixels"] == Metric(taken[-1].state["saturated"], "pixels")
    blind = replace(taken[-1], state=taken[-1].state | {"largest": 256})  # no value below full
    assert model.metrics([*taken, blind], ready.view, imager)["largest"].value is None
    # Full scale at 1 V/(lx s) and this exposure; the right one leaves the white step below it.
    assert metrics["exposure"].value * 1e-6 * 0.9 * 30_000 < 1.0
    assert model.latency(taken, ready.view, imager)[0].max_us == pytest.approx(
        max(start.delay, jump.delay) * 1e-6
    )


def test_an_adaptive_sensor_is_what_its_section_says():
    given = scenario(
        "adaptive-exposure", rows=16, columns=32, adapt=False, multiplier=50, search="half",
        window=[2, 4, 8, 16], threshold=3, writes=[["30 ms", "user", 200]],
    )  # fmt: skip
    model = model_of(given)
    assert isinstance(model, AdaptiveModel)
    imager = model.make()
    assert imager.read("adaptive_rows") == 9 << 16 | 2
    assert imager.read("adaptive_columns") == 19 << 16 | 4
    assert imager.read("adaptive_search") == 3 and imager.read("adaptive_threshold") == 3
    view = make_view(given, model.shape)
    taken = [
        measure_frame(f) for f in imager.film(view.scenery, PS // 10, seed=1, kept=frozenset())
    ]
    assert {round(t.seconds * 1e6) for t in taken} == {50, 200}
    with pytest.raises(InputError, match=r"imager\.window must be within 16 x 32 pixels"):
        model_of(scenario("adaptive-exposure", rows=16, columns=32, window=[10, 0, 8, 8])).make()
    with pytest.raises(InputError, match=r"imager\.frame_rate must be low enough"):
        model_of(scenario("adaptive-exposure", rows=2048, frame_rate="10 kHz")).make()


def test_an_ebaps_is_what_its_section_says():
    given = scenario(
        "ebaps", {"illuminance": "3e-3 lux"}, lens={"f_number": 1.4}, rows=24, columns=32,
        high_voltage="-800 V", exposure_loop=False, exposure="5 ms", duration="300 ms",
        writes=[["150 ms", "high_voltage", 1200]],
    )  # fmt: skip
    model = model_of(given)
    ready = plan_imager("x", given)
    assert ready.exposures.seconds == (5e-3, 5e-3)
    assert [m.volts for m in model.settings(ready.pixels)] == [800.0, 1200.0]
    imager = model.make()
    frames = imager.film(ready.view.scenery, ready.spec.stop, seed=1, kept=ready.kept)
    taken = [measure_frame(frame) for frame in frames]
    assert len(taken) == ready.exposures.frames
    assert [t.state["key"] for t in taken[:5]] == [1, 1, 1, 1, 0]
    assert {t.state["high_voltage"] for t in taken} == {800.0, 1200.0}
    metrics = model.metrics(taken, ready.view, imager)
    assert metrics["high_voltage"].value == -1200 and metrics["dark_frames"].value == 4
    own = np.sqrt(model.pixels.mean_variance(0.0, 5e-3)[1])
    left = np.sqrt(metrics["dark_noise"].value ** 2 * 1.25 + 5 / 64)
    assert metrics["dark_residual"].value == pytest.approx(left)
    assert 0.5 * own < metrics["dark_noise"].value < 2 * own  # few ion bursts in 768 pixels
    assert "contrast_to_noise" not in metrics  # grey steps have no bars


def test_the_bars_of_the_night_chart_stand_out_at_night_and_not_without_voltage():
    seen = []
    for volts, lux in (("-1500 V", "3e-3 lux"), ("0 V", "3e-1 lux")):
        given = scenario(
            "ebaps", {"illuminance": lux, "chart": "bars"}, lens={"f_number": 1.4}, rows=96,
            columns=96, high_voltage=volts, exposure_loop=False, exposure="25 ms",
            duration="260 ms", pedestal=2000,
        )  # fmt: skip
        model = model_of(given)
        ready = plan_imager("x", given)
        imager = model.make()
        frames = imager.film(ready.view.scenery, ready.spec.stop, seed=1, kept=ready.kept)
        metrics = model.metrics([measure_frame(f) for f in frames], ready.view, imager)
        assert metrics["bar_width"].value == pytest.approx(0.05 * 0.95 * 96)
        seen.append(metrics["contrast_to_noise"].value)
    assert seen[0] > 5 > seen[1]  # Rose


def test_an_emccds_frames_are_foreseen_through_its_writes():
    _, given = load("emccd-window")
    model = model_of(given)
    view = make_view(given, model.shape)
    stop = round(given.duration * PS)
    imager = model.make()

    class Blind:
        shape = model.shape

        def lux_seconds(self, first, begin, end):
            return np.zeros((begin.size, self.shape[1]))

    frames = [measure_frame(f) for f in imager.film(Blind(), stop, seed=1, kept=frozenset())]
    expected = model.exposures(view, stop)
    assert len(frames) == expected.frames
    assert expected.seconds == pytest.approx((2e-3, 20e-3))
    assert {t.state["external"] for t in frames} == {0.0, 1.0}
    assert {t.shape for t in frames} == {(512, 536), (256, 536), (128, 536)}
    assert frames[0].state["kelvin"] == pytest.approx(263.15, abs=0.05)
    assert len(model.settings(model.pixels)) == 2


def test_saturation_is_a_share_of_pixels_in_every_imager_that_says_it():
    """A white field that fills the wells: all pixels at the largest value, 1, unit "1"."""
    for kind, keys in (
        ("adaptive-exposure", {"rows": 16, "columns": 16, "adapt": False, "multiplier": 9000}),
        ("emccd", {"gain": 900}),
    ):
        given = scenario(kind, {"illuminance": "1e6 lux"}, duration="120 ms", **keys)
        model = model_of(given)
        ready = plan_imager("x", given)
        imager = model.make()
        frames = imager.film(ready.view.scenery, ready.spec.stop, seed=1, kept=ready.kept)
        taken = [measure_frame(frame) for frame in frames]
        metrics = model.metrics(taken, ready.view, imager)
        for name in ("saturated", "saturated_most"):
            assert metrics[name].unit == "1" and 0.9 < metrics[name].value <= 1
        texts = {name: metric_text(name, metric) for name, metric in metrics.items()}
        share = percent(metrics["saturated"].value)
        assert texts["saturated"] == (
            share, "of the pixels of the last frame have the largest value"
        )  # fmt: skip
    assert metric_text("settled", Metric(1.0, "1"))[0] == "yes"
    assert metric_text("settled", Metric(0.0, "1"))[0] == "no"
    assert metric_text("settled", Metric(None, "1"))[0] == "unknown"


def test_frames_that_are_checked_lie_within_the_run():
    for frames in (1, 2, 3, 5, 100):
        chosen = watched_frames(frames)
        assert chosen and min(chosen) >= 0 and max(chosen) < frames


@pytest.mark.parametrize(("name", "told"), [("adaptive-exposure", True), ("emccd-window", False)])
def test_accuracy_says_that_decisions_are_not_compared(viform, name, told):
    command = ["accuracy", name, "--set", "duration=10 ms"]
    if told:
        command += ["--set", "imager.rows=16", "--set", "imager.columns=32"]
    else:
        command += ["--set", "imager.rows=16"]
    document = json.loads(viform(*command, "--json").out)
    assert document["reference"]["decisions"] == ("not compared" if told else "none")
    assert ("decisions" in _text(name, document)) == told
