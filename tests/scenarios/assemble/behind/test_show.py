"""Sources other than a latched chip on the display: what is shown, and that a run goes on."""

import math
import os
import signal
import time

import numpy as np
import pytest

from cosim import Block, Clock, Events, InputError, Intensities, Interrupted, Viform
from cosim.files import open_stream, write_stream
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from cosim.spikes.clocked import held_events, held_reports
from cosim.spikes.events import only_full
from display.panels.panel import SpikePanel
from display.probes import metrics
from display.probes.blur import spike_blur
from display.probes.flicker import spike_flicker
from display.probes.setup import steady_light
from display.report.figures import _named
from imagers.catalogue import IMAGERS
from scenarios.assemble.behind import machine, screen
from scenarios.assemble.machine import assemble
from scenarios.assemble.schema.messages import validate
from scenarios.assemble.source import asynchronous, continuous
from scenarios.assemble.source.recording.machine import RecordedFeed, assemble_recording
from scenarios.report import write_report
from scenarios.run import run_scenario
from scenarios.scenes.drawing.analytic import spread_points
from sensor.asynchronous.pixel.array import AsynchronousPixels

CLOCK = Clock(40_000)
PANEL = {"beside": ["1000 Hz"], "projector": "none", "renderer": "numpy"}


def camera(readout, **keys):
    return {
        "title": readout, "duration": "3 ms", "display": PANEL,
        "scene": {"kind": "step", "illuminance": "700 lux", "at": "1 ms"},
        "sensor": {
            "chip": "spikeone", "threshold": "1000 e", "clock": "40 kHz", "pixel": readout,
            readout: {"width": 16, "height": 12} | keys.pop("pixels", {}),
        } | keys,
    }  # fmt: skip


def run(data, out, report=lambda machine, run: [], resume=False, progress=None):
    return run_scenario(
        "show", validate(data), out, options=Options(resume=resume),
        progress=progress or SilentProgress(), began=time.perf_counter(), report=report,
    )  # fmt: skip


def value(done, name):
    return done.result.metrics[name].value


@pytest.fixture
def _unprobed(monkeypatch):
    monkeypatch.setattr(asynchronous.EventProbeCamera, "of", lambda machine: None)
    monkeypatch.setattr(continuous, "ContinuousProbeCamera", lambda *_: None)


def reports(shape, clock, ticks, **columns):
    row, column, when, level = (columns[n] for n in ("row", "column", "time", "value"))
    return Intensities(
        np.array(row, np.uint16), np.array(column, np.uint16), np.array(when, np.int64),
        np.array(level, np.float64), shape, ticks, clock,
    )  # fmt: skip


def test_white_that_no_clock_is_fast_enough_for_has_no_display():
    data = camera("asynchronous", threshold="1 e", lens={"f_number": 0.5})
    data["scene"]["illuminance"] = "1e9 lux"
    with pytest.raises(InputError, match=r"^display must be absent where white fires at \S+ Hz"):
        assemble("x", validate(data), Options(), SilentProgress())


def test_a_probe_of_changes_is_filmed_a_part_at_a_time(monkeypatch):
    """Of seconds of noisy pixels, ten million events would be in memory together."""
    data = camera("asynchronous", pixels={"change": 0.05}, comparator_delay="9 us")
    del data["display"]
    made = assemble("x", validate(data), Options(), SilentProgress())
    probe = asynchronous.EventProbeCamera.of(made)
    light = steady_light((4, 4), probe.lux(0.4), CLOCK.edge(402))
    spans, step = [], AsynchronousPixels.step

    def watched(pixels, light, start, stop):
        spans.append((start, stop))
        return step(pixels, light, start, stop)

    monkeypatch.setattr(AsynchronousPixels, "step", watched)
    whole = probe.film(light, 400, (4, 4), 3)
    assert spans == [(0, CLOCK.edge(400))]
    monkeypatch.setattr(asynchronous, "PART", 128)
    parts = probe.film(light, 400, (4, 4), 3)
    assert spans[1:] == [(CLOCK.edge(n), CLOCK.edge(min(n + 128, 400))) for n in (0, 128, 256, 384)]
    np.testing.assert_array_equal(parts.words, whole.words)
    assert parts.planes()[128:].any()


def test_probes_of_pixels_with_millions_of_dark_spikes_are_left_out():
    """A second of a patch has 2e6 spikes a second and pixel, minutes of a core."""
    data = camera("asynchronous")
    data["sensor"]["pattern"] = {"dark_current": "2e9 e/s"}
    del data["display"]
    made = assemble("x", validate(data), Options(), SilentProgress())
    probe = asynchronous.EventProbeCamera.of(made)
    assert probe.spikes(0.0) == pytest.approx(2e9 / made.spec.model.threshold)
    rows = spike_flicker(probe, SpikePanel((4, 4), CLOCK, 0.6), (0.18,), 60.0, 1)
    assert rows and all(math.isnan(row.figures.svm) for row in rows)
    blurs = spike_blur(probe, SpikePanel((4, 4), CLOCK, 0.6), (0.0, 0.18), 1)
    assert all(math.isnan(row.width) for row in blurs)


def test_a_report_is_shown_from_its_own_cycle_on_at_its_rate():
    """White fires at 0.5 a cycle; half of white, reported in cycle 10, at 0.25."""
    held = held_reports(
        reports(
            (1, 2), CLOCK, 210, row=[0, 0], column=[0, 1], time=[10, 50], value=[500.0, 4000.0]
        ),
        1000.0, 0.5,
    )  # fmt: skip
    planes = held.step(None, Block(0, 210)).planes()[:, 0]
    assert planes[:10, 0].sum() == 0 and abs(int(planes[10:, 0].sum()) - 50) <= 1
    assert planes[50:, 1].all() and planes[:50, 1].sum() == 0 and held.clipped == 1


def events(time_, width, level=None, levels=1):
    n = len(time_)
    return Events(
        np.zeros(n, np.uint16), np.zeros(n, np.uint16), np.array(time_, np.int64),
        np.array(width, np.int64), (1, 1), 10**7, Clock(10**9),
        level=None if level is None else np.array(level, np.uint16), levels=levels,
    )  # fmt: skip


def test_a_width_is_held_until_the_next_event_and_a_reading_is_a_share_of_one():
    """250 us are 10 cycles: a spike each 10 cycles; then half the charge in 500 us: each 40."""
    told = events([1_000_000, 4_999_999], [250_000, 500_000], [4, 2], 4)
    planes = held_events(told, CLOCK, 400).step(None, Block(0, 400)).planes()[:, 0, 0]
    assert planes[:39].sum() == 0
    assert set(np.diff(np.flatnonzero(planes[39:199])).tolist()) == {10}
    assert set(np.diff(np.flatnonzero(planes[200:])).tolist()) <= {39, 40}
    assert [len(only_full(told)[0]), only_full(told)[1]] == [1, 1]
    assert only_full(events([1], [1]))[1] == 0


def test_what_a_pulse_imager_says_is_light_and_white_is_that_of_the_scene():
    section = validate({
        "title": "pwm", "duration": "3 ms", "imager": {"kind": "pwm", "rows": 8, "columns": 8},
        "scene": {"kind": "target", "illuminance": "100 lux"},
    }).imager  # fmt: skip
    model = IMAGERS["pwm"].model(section, 3e-3)
    pixels = model.pixels
    lux = 50.0
    width = pixels.threshold / (lux * pixels.responsivity + pixels.dark) / pixels.tick
    ticks = np.array([[round(width), 65_535]], np.uint16)
    levels, white = model.levels(ticks, 16, 100.0)
    assert levels[0, 0] / white == pytest.approx(0.5, rel=1e-3) and levels[0, 1] == 0


def test_frames_are_shown_as_their_digital_numbers(tmp_path):
    """From the end of a readout on, a pixel has fired as often as the held numbers say."""
    done = run(
        {
            "title": "chain", "duration": "4 ms", "display": PANEL | {"clock": "20 kHz"},
            "scene": {"kind": "target", "chart": "steps", "illuminance": "700 lux"},
            "imager": {"kind": "adaptive-exposure", "rows": 8, "columns": 16,
                       "frame_rate": "1 kHz", "adapt": False, "multiplier": 300},
            "image": {"at": [60]},
        }, tmp_path / "run",
    )  # fmt: skip
    import zarr

    frames = zarr.open_group(tmp_path / "run/frames.zarr", mode="r")
    values, ready = frames["values"][...].astype(np.int64), frames["ready"][...]
    shown = open_stream(tmp_path / "run/shown.zarr")
    assert (shown.cycles, shown.clock.hz) == (80, 20e3)
    planes = np.concatenate([Viform(shown.read_words(0, 3), 80, shown.clock).planes()])
    held = np.zeros((8, 16), np.int64)
    total = np.zeros((8, 16), np.int64)
    for cycle in range(80):
        for n in np.flatnonzero(-(-ready * 20_000 // 10**12) - 1 == cycle):
            held = values[n]
        total += held
        assert (abs(planes[: cycle + 1].sum(axis=0) - total / 255) <= 1).all()
    assert total.min() > 0 and value(done, "shown_clipped") == 0


def test_spikes_that_a_cycle_cannot_hold_are_counted(_unprobed, tmp_path):
    """White fires once a cycle, by chance sooner or later: some cycles have two spikes."""
    data = camera("asynchronous", threshold="50 e", clock="20 kHz", lens={"white_rate": 1.0})
    data["scene"] |= {"illuminance": "70 lux", "before": 1.0, "after": 1.0}
    done = run(data, tmp_path / "run")
    shown, lost = value(done, "shown_spikes"), value(done, "shown_lost")
    assert lost > 0 and shown + lost + value(done, "shown_late") == value(done, "events_carried")
    assert any("are not shown: raise sensor.clock" in note for note in done.outcome.notes)


def test_white_above_a_spike_a_cycle_is_refused(tmp_path):
    data = camera("asynchronous", clock="4 kHz", lens={"f_number": 1.4})
    with pytest.raises(InputError) as caught:
        run(data, tmp_path / "run")
    assert str(caught.value).startswith("sensor.clock must be at least ")
    assert "not 4000 Hz; raise it or sensor.threshold, set display.tone" in str(caught.value)


@pytest.mark.parametrize("readout", ["asynchronous", "continuous"])
def test_an_interrupted_display_plays_again_from_the_recording(_unprobed, tmp_path, readout):
    class Stopping(SilentProgress):
        playing = False

        def start(self, what, total):
            self.playing = what == "the display"

        def advance(self, done):
            if self.playing and done == 64:
                os.kill(os.getpid(), signal.SIGINT)

    data = camera(readout)
    whole = run(data, tmp_path / "whole")
    with pytest.raises(Interrupted, match="--resume"):
        run(data, tmp_path / "part", progress=Stopping())
    again = run(data, tmp_path / "part", resume=True)
    untimed = {"camera", "full_physics"}
    for name, metric in whole.result.metrics.items():
        if name not in untimed:
            assert again.result.metrics[name] == metric, name
    one, two = (open_stream(tmp_path / n / "shown.zarr") for n in ("whole", "part"))
    np.testing.assert_array_equal(one.read_words(0, 4), two.read_words(0, 4))
    assert not (tmp_path / "part/checkpoint.npz").exists()


def test_a_recording_is_shown_as_it_is_and_has_no_truth(tmp_path):
    planes = np.random.default_rng(2).random((130, 12, 16)) < 0.4
    write_stream(Viform.from_planes(planes, CLOCK), tmp_path / "a.npz")
    film = {"kind": "frames", "frame_rate": "500 Hz", "exposure": "1 ms", "readout": "1 ms"}
    data = {
        "title": "a", "sensor": {"source": f"file:{tmp_path / 'a.npz'}", "white_rate": 0.5},
        "display": PANEL | {"drive": "impulse"}, "camera": film,
    }  # fmt: skip
    done = run(data, tmp_path / "run", report=write_report)
    stream = open_stream(tmp_path / "run")
    np.testing.assert_array_equal(Viform(stream.read_words(0, 5), 130, CLOCK).planes(), planes)
    assert value(done, "psnr_spike") is None and value(done, "tfp_psnr") is None
    assert value(done, "total_light") == pytest.approx(1)
    assert value(done, "camera_frames") == 1
    page = (tmp_path / "run/report.html").read_text(encoding="utf-8")
    assert "a recorded stream has no true light" in page and "Bands: the mean of each row" in page
    files = {str(p.relative_to(tmp_path / "run")) for p in (tmp_path / "run").rglob("*.*")
             if p.is_file() and "stream.zarr" not in str(p)}  # fmt: skip
    assert files == set(done.result.files) - {"stream.zarr"}


def filmed(folder, planes, **sensor):
    """A recording on a panel of the impulse drive, filmed by a spike camera; white is 0.5 spikes a
    cycle on the panel."""
    write_stream(Viform.from_planes(planes, CLOCK), folder / "a.npz")
    chip = {"threshold": "1000 e", "clock": "20 kHz", "lens": {"white_rate": 0.8}} | sensor
    return {
        "title": "a", "sensor": {"source": f"file:{folder / 'a.npz'}", "white_rate": 0.5},
        "display": PANEL | {"drive": "impulse"}, "camera": {"kind": "spikes", "sensor": chip},
    }  # fmt: skip


def test_a_spike_camera_sees_the_light_of_the_panel(tmp_path):
    """Columns of the panel are white, half white and dark: 0.8, 0.4 and no spikes a cycle. Light
    begins at the end of plane 0, and a row is later by its place in the scan."""
    planes = np.zeros((400, 6, 30), bool)
    planes[::2, :, :10], planes[::4, :, 10:20] = True, True
    done = run(filmed(tmp_path, planes), tmp_path / "run", report=write_report)
    stream = open_stream(tmp_path / "run/camera.zarr")
    assert stream.shape == (6, 30) and stream.cycles == 200 and stream.clock.hz == 20e3
    seen = Viform(stream.read_words(0, 7), 200, stream.clock).planes()
    for columns, rate in ((slice(10), 0.8), (slice(10, 20), 0.4), (slice(20, 30), 0.0)):
        counts = seen[:, :, columns].sum(axis=0)
        # A Poisson threshold of 1000 e: the deviation of n spikes is sqrt(n / 1000).
        assert abs(counts.mean() - rate * 199.5) < 1 + 5 * np.sqrt(rate * 199 / 1000 / 60)
    assert value(done, "camera_white_rate") == 0.8
    page = (tmp_path / "run/report.html").read_text(encoding="utf-8")
    assert "What a spike camera sees of the display" in page
    assert {"camera.zarr", "images/filmed-00020.png"} <= set(done.result.files)


def test_the_device_of_a_run_is_that_of_its_display_also_when_it_is_made_anew(
    tmp_path, monkeypatch
):
    """Of the renderer, and of the spike camera that films the panel."""
    made, make, wanted = [], screen.make_display_chain, object()
    monkeypatch.setattr(screen, "make_display_chain", lambda *given: made.append(given[-1]) or make(
        *given[:-1], None))  # fmt: skip
    monkeypatch.setattr(machine, "choose_device", lambda name: {"a GPU": wanted}[name])
    data = validate(filmed(tmp_path, np.ones((320, 6, 8), bool)))
    source = assemble_recording("a", data)
    shown = machine.with_behind(data, source, RecordedFeed(source), "a GPU", SilentProgress())
    again = shown.behind.renewed(shown.feed)
    assert made == [wanted, wanted]
    assert shown.behind.screen.camera.device is again.screen.camera.device is wanted
    again.close()


def test_a_spike_camera_goes_on_from_its_checkpoint(tmp_path):
    planes = np.random.default_rng(7).random((320, 6, 8)) < 0.3
    data = validate(filmed(tmp_path, planes))
    made = assemble("a", data, Options(), SilentProgress())
    filmer = made.behind.screen.camera
    stream = Viform.from_planes(planes, CLOCK)
    for name, size in (("one", 320), ("two", 64)):
        (stage,) = filmer.stages(tmp_path / name).values()
        for first in range(0, 320, size):
            stage.step(
                Viform(stream.words[first // 32 : (first + size) // 32], size, CLOCK, first),
                Block(first, size),
            )  # fmt: skip
            (after,) = filmer.stages(tmp_path / name).values()
            after.restore({key: each.copy() for key, each in stage.state().items()})
            stage = after
    made.close()
    one, two = (open_stream(tmp_path / n / "camera.zarr") for n in ("one", "two"))
    assert one.cycles == two.cycles == 160
    np.testing.assert_array_equal(one.read_words(0, 5), two.read_words(0, 5))


def test_only_a_latched_chip_films_the_display(tmp_path):
    data = filmed(tmp_path, np.zeros((64, 2, 2), bool), pixel="continuous")
    with pytest.raises(InputError) as caught:
        run(data, tmp_path / "run")
    assert str(caught.value) == (
        "camera.sensor.pixel must be latched, not continuous; leave it out: a latched, "
        "simulated chip films the display, with a pixel for each of the panel"
    )


def test_the_chip_that_films_the_display_has_the_pixels_of_the_panel(tmp_path):
    data = filmed(tmp_path, np.zeros((64, 2, 2), bool), width=50)
    with pytest.raises(InputError, match=r"camera\.sensor\.width must be absent, not given; leave"):
        run(data, tmp_path / "run")


@pytest.mark.slow
@pytest.mark.parametrize("readout", ["asynchronous", "continuous"])
def test_the_probes_of_a_camera_without_a_latch_say_its_delay(readout, tmp_path, monkeypatch):
    """Mid grey fires at 0.18 a cycle, 139 us; from the dark the impulse drive waits for the first
    spike of an asynchronous pixel, and for the filter of 250 us of a continuous one besides."""
    monkeypatch.setattr(metrics, "RATES", (metrics.GREY, metrics.BRIGHT))
    monkeypatch.setattr(metrics, "EDGES", ((0.0, metrics.GREY),))
    done = run(camera(readout), tmp_path / "run", report=write_report)
    least, most = {"asynchronous": (100, 250), "continuous": (100, 600)}[readout]
    assert least < value(done, "latency_grey_us") < most
    assert value(done, "ebet_ms_spike") < value(done, "ebet_ms_1000hz")
    stages = [row.stage for row in done.result.latency]
    assert stages[-4:] == ["interval", "readout", "transport", "hold"]
    assert "From photon to photon" in (tmp_path / "run/report.html").read_text(encoding="utf-8")


def test_a_pixel_of_interest_is_titled_once():
    points = *spread_points((50, 80), 1), (5, 6, "bar 1")
    assert [_named(point)[1] for point in points] == [points[0][2], "bar 1 (row 5, column 6)"]
