"""A new drive, added here and nowhere else, works in every part of the program.

Fading: each spike adds a packet that fades exponentially over the planes. Its memory is the light
at the last spike, m = m d^interval + 1; the level is (1 - d) m d^age.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.spikes.viform import unpack_planes
from display import SpikePanel
from display.drives import DRIVES, Drive
from display.plan.pixels import PanelPixels
from display.probes import metrics
from display.probes.waveform import panel_light
from display.render.golden import GoldenRenderer
from display.render.opencl import OpenCLRenderer
from display.render.renderer import Renderer
from scenarios.assemble.schema import export as exporting
from scenarios.assemble.schema.export import export
from scenarios.cli.entry import _main

FADE = 0.75
"""Of the light that is left, from plane to plane."""
SHAPE = (12, 20)
PLANES = 256
PANEL = SpikePanel(SHAPE, Clock(40_000), 0.6)


def _level(age: Any, tau: Any, memory: Any) -> Any:
    return (1 - FADE) * memory * FADE**age


def _remember(memory: Any, interval: Any, emitted: Any) -> Any:
    return memory * FADE**interval + 1.0


def _fluctuation(rate: Any, variance: Any, reach: float) -> Any:
    """As of packets: what fades slowly is spread over planes, not lessened."""
    return np.sqrt(rate * np.maximum(1 - rate, 0.1))


def _variation(rate: Any, variance: Any, motion: Any, swing: float) -> Any:
    return np.full_like(rate, 2 * (1 - FADE))


FADING = Drive(
    "fading", 1, _level, f"{1 - FADE} * memory * pow(vec4({FADE}), AGE)", _fluctuation, _variation,
    _remember, f"memory * pow(vec4({FADE}), run) + 1.0",
)  # fmt: skip


@pytest.fixture(autouse=True)
def fading(monkeypatch: pytest.MonkeyPatch) -> Iterator[SpikePanel]:
    """The catalogue has one drive more; the panel shows it. The exported schema is cached, so it
    is forgotten before and after."""
    monkeypatch.setitem(DRIVES, "fading", FADING)
    exporting._export.cache_clear()
    yield replace(PANEL, drive="fading")
    exporting._export.cache_clear()


@pytest.fixture
def words(stream: Callable[..., Any]) -> Any:
    rate = np.random.default_rng(3).uniform(0.0, 0.9, SHAPE)
    rate[0, 0] = 0.0
    return stream(PLANES, rate)


@pytest.fixture
def light(words: Any) -> Any:
    """(planes, height, width): the spikes, each faded."""
    spikes = unpack_planes(words, 0, PLANES).astype(float)
    out, level = np.zeros_like(spikes), np.zeros(SHAPE)
    for n, plane in enumerate(spikes):
        level = level * FADE + plane
        out[n] = (1 - FADE) * level
    return out


def test_the_golden_model_fades(fading, words, light):
    golden = GoldenRenderer(fading, 1, 0)
    half = PLANES // 64
    for n, due in enumerate(np.split(light, 2)):  # memory goes on from block to block
        golden.step(words[n * half : (n + 1) * half], PLANES // 2, None)
        np.testing.assert_allclose(golden.light, due, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("emitter", [(0.0, 0.0), (1e-5, 3e-5)])
def test_compiled_pixels_and_waveforms_are_the_golden_model(fading, words, emitter):
    panel = replace(fading, rise=emitter[0], decay=emitter[1])
    golden = GoldenRenderer(panel, 1, 0)
    golden.step(words, PLANES, None)
    pixels = PanelPixels(panel, SHAPE[0] * SHAPE[1])
    shown = pixels.light(words.reshape(len(words), -1), PLANES, 1)
    np.testing.assert_allclose(shown, golden.light.reshape(PLANES, -1), rtol=1e-12, atol=1e-15)
    wave = panel_light(Viform(words, PLANES, panel.clock), panel, "fading")
    np.testing.assert_allclose(wave, golden.light.reshape(PLANES, -1), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("emitter", [(0.0, 0.0), (1e-5, 3e-5)])
@pytest.mark.parametrize("tested", [Renderer, OpenCLRenderer])
def test_shaders_and_kernels_are_the_golden_model(gl, fading, words, views, emitter, tested):
    panel = replace(fading, rise=emitter[0], decay=emitter[1])
    seen = views(3, PLANES // 8, still=1)
    images = []
    for make in (GoldenRenderer, tested):
        renderer = make(panel, 8, 3)
        try:
            renderer.step(words[:4], 128, _half(seen, 0))
            renderer.restore(renderer.state())
            renderer.step(words[4:], 128, _half(seen, 1))
            images.append(np.stack([renderer.take(n) for n in range(3)]))
        finally:
            renderer.close()
    golden, ours = images
    np.testing.assert_allclose(ours, golden, atol=1e-6 * np.abs(golden).max())


def _half(views: Any, which: int) -> Any:
    size = views.weight.shape[1] // 2
    part = slice(which * size, (which + 1) * size)
    return type(views)(*(values[:, part] for values in vars(views).values()))


def test_the_schema_names_it():
    fields = export()["$defs"]["DisplaySection"]["properties"]
    names = fields["drive"]["enum"]
    assert names[:3] == ["impulse", "hold", "causal"] and names[-1] == "fading"


def _run(renderer: str, tmp_path: Path, capsys: Any, monkeypatch: Any) -> dict[str, Any]:
    """The document of a short run with the drive; latencies at two rates and one edge only."""
    monkeypatch.setattr(metrics, "RATES", (metrics.GREY, metrics.BRIGHT))
    monkeypatch.setattr(metrics, "EDGES", ((0.0, metrics.GREY),))
    sets = ["sensor.chip=spikeone", "duration=2.5 ms", "image.at=[50]", "display.drive=fading",
            'display.beside=["120 Hz"]', "tolerance=0.05"]  # fmt: skip
    sets.append(f"display.renderer={renderer}")
    words = [word for assignment in sets for word in ("--set", assignment)]
    assert _main(["run", "glass", "--json", "--out", str(tmp_path / renderer), *words]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_a_scenario_runs_with_it(gl, tmp_path: Path, capsys, monkeypatch):
    document = _run("gl", tmp_path, capsys, monkeypatch)
    effects = [*document["plan"]["kept"], *(row["effect"] for row in document["plan"]["left_out"])]
    assert "planes within 8" in effects
    for row in document["plan"]["left_out"]:
        assert row["measured"] is None or row["measured"] <= row["bound"]
    assert 0 <= document["error"]["value"] <= 0.05 and "radiance" in document["error"]["kind"]
    figures = {name: metric["value"] for name, metric in document["metrics"].items()}
    assert figures["latency_bright_us_fading"] > figures["latency_bright_us"]
    assert figures["ebet_ms_fading"] == figures["ebet_ms_spike"] > figures["ebet_ms_impulse"]
    page = (tmp_path / "gl" / "report.html").read_text(encoding="utf-8")
    assert "spikes, fading" in page and "spike-continuous panel, fading" in page


@pytest.mark.slow
def test_the_golden_renderer_shows_the_same(gl, tmp_path: Path, capsys, monkeypatch):
    figures, golden = (
        _run(renderer, tmp_path, capsys, monkeypatch)["metrics"] for renderer in ("gl", "numpy")
    )
    for name in ("psnr_spike", "psnr_pursuit_spike", "total_light"):
        assert figures[name]["value"] == pytest.approx(golden[name]["value"], rel=1e-5), name
