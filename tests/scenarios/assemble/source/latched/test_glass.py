"""A run with a display: what eyes see, how good it is, and that it goes on where it was."""

from __future__ import annotations

import json
import math
import os
import re
import signal
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from skimage.metrics import structural_similarity

from cosim import Block, Clock, Interrupted, Light, Piece, Viform
from cosim.light.ssim import Likeness, inside
from cosim.run.shown import SilentProgress
from cosim.spikes.viform import pack_planes
from display import CameraPlane, DisplaySetting, SpikePanel
from display.chain.clip import chosen_tiles
from display.chain.display import DisplayChain, PanelStage
from display.chain.tap import LightTap, panel_waves, spike_waves
from display.observe.slow_motion import SlowMotion
from display.panels.panel import FramePanel, metric_key
from display.probes import metrics
from display.probes.metrics import Probes
from display.quality.fidelity import BANDS, display_fidelity
from display.render.golden import GoldenRenderer
from scenarios.report import write_report

CLOCK = Clock(40_000)
SETS = ("duration=4 ms", "image.at=[60, 90]", 'display.beside=["120 Hz", "1000 Hz"]')
"""160 cycles of 400 x 250 pixels of the chart: one draw of 128 planes, and one that is not full."""


class Shot:
    """A whole run with what it leaves in memory."""

    def __init__(self, film: Any, out: Path, *sets: str, page: bool = False, **how: Any) -> None:
        runs: list[Any] = []

        def report(machine: Any, run: Any) -> list[str]:
            runs.append(run.outcome.views.screen)
            return write_report(machine, run) if page else []

        self.result, self.folder = film("glass", out, *SETS, *sets, report=report, **how)
        (seen,) = runs
        self.outcome, self.stream = seen.display, seen.stream

    def images(self, observer: str = "eye") -> Any:
        return self.outcome.images["spike"][observer]

    def value(self, name: str) -> float:
        value: float = self.result.metrics[name].value
        return value


@pytest.fixture(scope="module")
def drawn(film, tmp_path_factory) -> Shot:
    """By OpenGL, with its page; of the lights that displays are probed with, two."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(metrics, "RATES", (metrics.GREY, metrics.BRIGHT))
        patch.setattr(metrics, "EDGES", ((0.0, metrics.GREY),))
        return Shot(film, tmp_path_factory.mktemp("runs") / "gl", page=True)


@pytest.fixture
def probed(drawn: Shot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Probes are those of the first run: they depend on nothing that these tests change."""
    probes: Probes = drawn.outcome.probes
    monkeypatch.setattr(DisplayChain, "probes", lambda *_: probes)


def test_the_document_says_what_was_seen(drawn):
    document = json.loads((drawn.folder / "result.json").read_text(encoding="utf-8"))
    assert document["renderer"] == drawn.outcome.chain.panel_stage.renderer.name
    figures = document["metrics"]
    for name in ("spike", "120hz", "1000hz", "projector"):
        for kind in ("psnr", "psnr_pursuit"):
            assert figures[f"{kind}_{name}"]["unit"] == "dB"
        assert 0 < figures[f"ssim_{name}"]["value"] <= 1
    assert {"latency_bright_us", "ebet_ms_spike", "ebet_ms_120hz", "flicker_svm_spike"} <= set(
        figures
    )
    assert not any(name.startswith(("tfp", "tfi", "size")) for name in figures)
    stages = ["interval", "readout", "transport", "hold"]
    assert [row["stage"] for row in document["latency"]] == stages
    assert [row["stage"] for row in document["throughput"]] == ["sensor", "recorder", "display"]
    assert document["throughput"][2]["unit"] == "planes/s"
    files = {str(p.relative_to(drawn.folder)) for p in drawn.folder.rglob("*") if p.is_file()}
    assert set(document["files"]) - {"stream.zarr"} == {
        name for name in files if not name.startswith("stream.zarr")
    }


def test_psnr_follows_from_the_pictures_of_the_middle_instant(drawn):
    truth, image = (
        cv2.imread(str(drawn.folder / f"images/eye-{name}.png"), cv2.IMREAD_UNCHANGED) / 255
        for name in ("truth", "120hz")
    )
    rms = math.sqrt(np.mean((image - truth) ** 2))
    seen = drawn.outcome.images
    exact = np.clip(seen["120 Hz"]["eye"][1], 0, 1) - np.clip(seen["truth"]["eye"][1], 0, 1)
    # Both pictures are rounded by at most half a step of 1/255.
    assert rms == pytest.approx(float(np.sqrt(np.mean(exact**2))), abs=1 / 255)
    levels = [
        -10 * math.log10(np.mean((np.clip(a, 0, 1) - np.clip(b, 0, 1)) ** 2))
        for a, b in zip(seen["120 Hz"]["eye"], seen["truth"]["eye"], strict=True)
    ]
    assert drawn.value("psnr_120hz") == pytest.approx(np.mean(levels), rel=1e-5)


def test_the_golden_model_sees_the_same(drawn, probed, film, tmp_path):
    golden = Shot(film, tmp_path / "numpy", "display.renderer=numpy")
    assert golden.result.renderer == "numpy, float64"
    for observer in ("eye", "pursuit"):
        np.testing.assert_allclose(drawn.images(observer), golden.images(observer), atol=2e-6)
    for name in ("psnr_spike", "ssim_spike", "psnr_pursuit_spike", "total_light"):
        assert drawn.value(name) == pytest.approx(golden.value(name), rel=1e-6)
    away = drawn.outcome.frames["spike"].astype(int) - golden.outcome.frames["spike"]
    assert np.abs(away).max() <= 1  # a level that lies on the edge of two 8-bit steps


def test_packets_are_all_shown(probed, film, tmp_path):
    shot = Shot(film, tmp_path / "run", "display.drive=impulse")
    assert shot.value("total_light") == pytest.approx(1, abs=1e-6)


def test_a_run_that_is_gone_on_with_sees_the_same(drawn, probed, film, tmp_path):
    class Stopping(SilentProgress):
        def advance(self, done: int) -> None:
            if done == 64:
                os.kill(os.getpid(), signal.SIGINT)

    folder = tmp_path / "run"
    # The stages are blocks ahead of the display: those under way are finished first.
    with pytest.raises(Interrupted, match=r"(?:64|128|160) of 160"):
        film("glass", folder, *SETS, progress=Stopping())
    gone_on = Shot(film, folder, resume=True)
    for name, views in drawn.outcome.images.items():
        for observer, images in views.items():
            np.testing.assert_array_equal(gone_on.outcome.images[name][observer], images)
        np.testing.assert_array_equal(gone_on.outcome.frames[name], drawn.outcome.frames[name])
    assert gone_on.value("total_light") == drawn.value("total_light")
    again = Shot(film, tmp_path / "other", "seed=2")
    assert not np.array_equal(again.images(), drawn.images())


def test_a_run_interrupted_in_its_report_has_its_images(drawn, probed, film, tmp_path):
    def stop(machine: Any, run: Any) -> list[str]:
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="160 of 160"):
        film("glass", tmp_path / "run", *SETS, report=stop)
    gone_on = Shot(film, tmp_path / "run", resume=True)
    np.testing.assert_array_equal(gone_on.images(), drawn.images())
    assert gone_on.result.throughput == []


def test_a_panel_of_another_size_shows_what_fits(probed, film, tmp_path):
    shot = Shot(
        film, tmp_path / "run", "display.width=200", "display.height=125", "display.fit=nearest",
        "display.renderer=numpy",
    )  # fmt: skip
    assert shot.images().shape == shot.outcome.images["120 Hz"]["eye"].shape == (2, 125, 200)
    # Every second pixel of the truth is what the panel is held against.
    whole = shot.outcome.chain.references.images()["truth"]["eye"]
    np.testing.assert_array_equal(shot.outcome.images["truth"]["eye"], whole[:, 1::2, 1::2])
    assert shot.value("psnr_spike") > 20


# What is refused.

RUN = ("run", "glass", "--set", "sensor.chip=spikeone", "--set", "duration=4 ms")


def test_a_panel_of_another_size_is_refused(refused, tmp_path):
    line = refused(*RUN, "--set", "display.width=100", "--out", tmp_path / "run")
    assert line == (
        "display.width and display.height must be the stream's 400 x 250, not 100 x 250; leave "
        "them out, or set display.fit=nearest or centre"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_machine_without_gl_says_so_before_anything_is_written(refused, tmp_path, monkeypatch):
    import moderngl

    def none(**_: Any) -> None:
        raise ValueError("requested device index 0, but found 0 devices")

    monkeypatch.setattr(moderngl, "create_context", none)
    line = refused(*RUN, "--set", "display.renderer=gl", "--out", tmp_path / "run")
    assert "the EGL vendor must be" in line and "display.renderer=numpy" in line
    assert list(tmp_path.iterdir()) == []


def test_a_machine_without_gl_shows_with_opencl(viform, tmp_path, monkeypatch):
    import moderngl

    def none(**_: Any) -> None:
        raise ValueError("requested device index 0, but found 0 devices")

    monkeypatch.setattr(moderngl, "create_context", none)
    done = viform(*RUN, "--out", tmp_path / "run", "--json")
    assert done.code == 0 and json.loads(done.out)["renderer"].startswith("OpenCL")


# Figures.


def test_fidelity_of_a_known_error_by_luminance():
    truth = np.full((1, 40, 40), 0.2, np.float32)
    truth[:, :, 20:] = 0.8
    image = truth + np.float32(0.02)
    image[:, :, 20:] -= np.float32(0.1)
    (fidelity,) = display_fidelity({"truth": {"eye": truth}, "60 Hz": {"eye": image}}, ["eye"])
    assert fidelity.psnr == pytest.approx(-10 * math.log10((0.02**2 + 0.08**2) / 2), rel=1e-5)
    dim, bright = fidelity.bands
    assert (dim.low, bright.high) == (BANDS[3], BANDS[5])
    assert dim.share == bright.share == 0.5
    assert dim.psnr == pytest.approx(-20 * math.log10(0.02), rel=1e-5)
    assert (dim.bias, dim.spread) == pytest.approx((0.1, 0.1), rel=1e-5)
    assert (bright.bias, bright.spread) == pytest.approx((-0.1, 0.1), rel=1e-5)
    assert set(fidelity.metrics()) == {"psnr_60hz", "ssim_60hz"}


def test_structural_similarity_is_that_of_scikit_image():
    random = np.random.default_rng(1)
    truth = cv2.GaussianBlur(random.random((60, 80)), (0, 0), 2).astype(np.float32)
    image = np.clip(truth + 0.05 * random.standard_normal(truth.shape), 0, 1).astype(np.float32)
    how = {"data_range": 1.0, "gaussian_weights": True, "use_sample_covariance": False}
    expected = structural_similarity(image, truth, sigma=1.5, full=True, **how)[1]
    # float32 of means of squares up to 0.25: 1e-7 beside C2 = 9e-4.
    np.testing.assert_allclose(Likeness(truth).map(image), expected, atol=5e-4)
    assert float(inside(Likeness(truth).map(image)).mean()) == pytest.approx(
        float(expected[5:-5, 5:-5].mean()), abs=1e-5
    )


def test_names_of_displays_in_metrics():
    names = ["spike", "59.94 Hz", "1000 Hz", "16 kHz binary"]
    assert [metric_key(name) for name in names] == ["spike", "59_94hz", "1000hz", "projector"]


def test_the_clip_has_so_many_tiles():
    frames = [f"{n} Hz" for n in (60, 120, 240, 1000)]
    names = ["truth", "spike", *frames, "16 kHz binary"]
    assert chosen_tiles(names) == names
    assert chosen_tiles(names, 6) == [
        "truth",
        "spike",
        "60 Hz",
        "120 Hz",
        "1000 Hz",
        "16 kHz binary",
    ]
    assert chosen_tiles(names[:4], 6) == names[:4]


def test_the_slow_motion_plays_in_browsers(drawn):
    with av.open(str(drawn.folder / "glass.mp4")) as container:
        video = container.streams.video[0]
        assert (video.codec_context.name, video.codec_context.pix_fmt) == ("h264", "yuv420p")
        frames = [frame.to_ndarray(format="gray") for frame in container.decode(video)]
    motion = drawn.outcome.chain.motion
    assert len(frames) == motion.count == 160  # of a cycle
    assert motion.exposure == CLOCK.edge(1)
    height, width = motion.shape
    tile = frames[60][6 + 26 : 6 + 26 + height, 6 : 6 + width]
    truth = drawn.outcome.frames["truth"][60]
    assert np.abs(tile.astype(int) - truth).mean() < 4  # H.264 at crf 21


def test_the_page_needs_no_network_and_shows_every_display(drawn):
    page = (drawn.folder / "report.html").read_text(encoding="utf-8")
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)
    for title in ("clear glass", "spikes, causal", "spikes, impulse", "120 Hz", "16 kHz binary"):
        assert title in page
    assert not re.search(r"\b(?:nan|inf)\b", re.sub(r"base64,[^\"]*", "", page).lower())


@pytest.mark.parametrize(("cycles", "late"), [(320, 0), (320, 40), (320, 400), (1, 0)])
def test_the_slow_motion_is_dark_until_light_comes(cycles, late):
    """late: cycles of transport. Every pixel spikes in every cycle."""
    panel = SpikePanel((4, 6), CLOCK, 1.0, "impulse", row_scan=0.0, transport=CLOCK.edge(late))
    every = min(8, cycles)
    motion = SlowMotion((4, 6), 0, CLOCK.edge(cycles), CLOCK.edge(every), 1)
    still = CameraPlane((CLOCK.edge(cycles),), CLOCK.edge(cycles))
    setting = DisplaySetting(panel, still, 1)
    stage = PanelStage(
        setting, {"camera": still}, motion, cycles, lambda n: GoldenRenderer(panel, 1, n)
    )
    for first in range(0, cycles, 64):
        block = Block(first, min(64, cycles - first))
        words = pack_planes(np.ones((block.cycles, 4, 6), np.uint8))
        stage.step(Viform(words, block.cycles, CLOCK), block)
    frames = stage.film.frames[:, 0, 0].astype(int)
    starts = np.arange(len(frames)) * every
    whole = starts >= late + 1  # the first plane is shown when its cycle is over
    assert len(frames) == cycles // every
    assert (frames[whole] == 255).all()
    assert (frames[starts + every <= late + 1] == 0).all()


def test_the_table_on_a_terminal(drawn):
    from display.report.tables import display_lines

    lines = display_lines(drawn.outcome)
    assert lines[0].split() == ["display", "EBET", "SVM", "PSNR", "still", "pursuing", "delay"]
    assert [line[:8].strip() for line in lines[1:-1]] == [
        "spikes,", "spikes,", "spikes,", "120 Hz", "1000 Hz", "16 kHz b",
    ]  # fmt: skip
    assert lines[1].startswith("spikes, causal") and lines[1].count("dB") == 2
    assert len({len(line) for line in lines[:-1]}) == 1


def test_the_light_of_a_pixel_is_kept_and_a_hold_shows_it(tmp_path):
    first, last = np.zeros((4, 6), np.float32), np.full((4, 6), 50.0, np.float32)
    stop = CLOCK.edge(400)
    whole = Light((Piece(0, stop, first, last),))
    tap = LightTap([(1, 2), (3, 5)], CLOCK, 100.0)
    for start in (0, 64):
        assert tap.step(whole, Block(start, 64)) is whole
    light = tap.light()
    assert len(light.pieces) == 1
    np.testing.assert_allclose(light.at(stop // 2)[0], 0.25, rtol=1e-6)
    at = np.array([stop // 10, stop // 2 + stop // 100], np.int64)  # of 10 ms, at 1 and 5.1 ms
    wave = panel_waves(FramePanel(Clock(1000)), light, at)
    np.testing.assert_allclose(wave[:, 0], [0.05, 0.25], rtol=1e-6)  # of 1 and 5 ms


def test_the_light_of_spikes_plane_by_plane(drawn):
    stream = drawn.stream
    panel = SpikePanel(stream.shape, CLOCK, 0.6, "impulse")
    starts, light = spike_waves(stream, panel, [(200, 100), (20, 380)], CLOCK.edge(160) - 1)
    planes = stream.read_words(0, 5)[:, [200, 20], [100, 380]]
    spikes = (planes[np.arange(160) // 32] >> (np.arange(160) % 32)[:, None]) & 1
    np.testing.assert_allclose(light, spikes / 0.6)
    assert starts[0] == CLOCK.edge(1) and len(starts) == 161
