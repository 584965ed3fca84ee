"""Scenes of high dynamic range on a display: the sun and the stars seen, and refusals."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Light, Piece
from cosim.stage import Block
from display.panels.tone import Tone, closed_form
from scenarios.assemble.source.feeds import TonedSource
from scenarios.scenes.charts.sky import Sky

SIZE = 160
SKY = (
    f"sensor.asynchronous.width={SIZE}", f"sensor.asynchronous.height={SIZE}",
    "sensor.clock=20 kHz", "duration=800 ms", "display.beside=[]", "display.projector=none",
    "display.peak=1000 cd/m2",
)  # fmt: skip


def _words(*sets: str) -> list[str]:
    return [word for each in sets for word in ("--set", each)]


@pytest.mark.parametrize(
    ("law", "decades", "luminance"),
    [("log", 5.0, 1000.0), ("reinhard", 3.0, 1000.0), ("clip", 8.0, 4000.0)],
)
def test_the_sun_and_the_stars_are_seen_as_panel_and_eye_allow(
    viform: Callable[..., Any], tmp_path: Path, law: Any, decades: float, luminance: float
) -> None:
    """The range seen is that of the closed form of law, panel and eye within half a decibel. The
    eye has adapted to the mean of the panel under the true light."""
    done = viform(
        "run", "sun-and-stars", *_words(*SKY, f"display.tone={law}"),
        *_words(f"display.tone_decades={decades}", f"display.luminance={luminance} cd/m2"),
        "--report", "none", "--json", "--out", tmp_path / "run",
    )  # fmt: skip
    assert done.code == 0, done.err
    result = json.loads(done.out)
    found = {name: metric["value"] for name, metric in result["metrics"].items()}
    tone = Tone(law, luminance, 1000.0, decades)
    sky = Sky((SIZE, SIZE), 1e5, 1e-6, 0.0)
    adapted = 1000 * float(tone.share(sky.reflectance(0.0)).mean())
    top, dim = closed_form(tone, 1.0, 1e-11, adapted)
    assert found["scene_decades"] == pytest.approx(11, abs=0.01)
    assert found["eye_adapted_to"] == pytest.approx(adapted, rel=0.03)
    assert abs(found["seen_range"] - 20 * (11 - top - dim)) < 0.5
    assert found["lost_at_the_peak_decades"] == pytest.approx(top)
    assert (top > 0.5) == (law == "clip")
    lost = (
        "lost_at_the_peak_decades", "lost_to_the_eye_decades", "lost_before_the_panel_decades"
    )  # fmt: skip
    assert found["seen_decades"] + sum(found[n] for n in lost) == pytest.approx(11, abs=0.01)
    assert "of the scene's 11.00 decades" in done.err
    # Panel and true light pass the same law.
    assert found["psnr_spike"] > 25


def test_continuous_pixels_pass_the_law_too(viform: Callable[..., Any], tmp_path: Path) -> None:
    sets = (
        "sensor.pixel=continuous", "sensor.continuous.width=40", "sensor.continuous.height=16",
        "duration=40 ms", "scene.at=39 ms", "scene.before=0.9", "display.beside=[]",
        "display.projector=none", "display.tone=log", "display.tone_decades=2", "image.at=[1500]",
    )  # fmt: skip
    done = viform("run", "step", *_words(*sets), "--json", "--out", tmp_path / "run")
    assert done.code == 0, done.err
    metrics = json.loads(done.out)["metrics"]
    assert metrics["shown_white_rate"]["value"] == pytest.approx(1)
    assert metrics["psnr_spike"]["value"] > 30
    assert metrics["seen_decades"]["value"] is None  # a wedge has no targets
    # Bars of n/8 of .9 of white: the mean of their shares is what the panel fires.
    tone = Tone("log", 300.0, 300.0, 2.0)
    share = float(tone.share(0.9 * np.arange(1, 9) / 8).mean())
    assert metrics["shown_rate"]["value"] == pytest.approx(share, rel=0.03)


def test_a_law_maps_light_between_knots_and_keeps_pieces() -> None:
    class Ramp:
        shape, notes, degraded = (1, 2), ["a"], ["b"]

        def __init__(self) -> None:
            first, last = np.float32([[0, 50]]), np.float32([[100, 50]])
            self.light = Light((Piece(0, 10, first, last), Piece(10, 20, last, last)))

        def step(self, data: None, block: Block) -> Light:
            return self.light

        def truth(self, ps: int) -> np.ndarray:
            return np.float32([[1, 0.5]])

        def points(self) -> list[Any]:
            return []

    tone = Tone("clip", 100.0, 25.0, 8.0)  # white is four times the peak
    source = TonedSource(Ramp(), tone, 100.0)
    ramp, still = source.step(None, Block(0, 1)).pieces
    assert ramp.last.tolist() == [[100, 100]] and ramp.first.tolist() == [[0, 100]]
    assert still.constant and source.step(None, Block(0, 1)).pieces[1] is still
    assert source.truth(0).tolist() == [[1, 1]] and source.degraded == ["b"]


@pytest.mark.parametrize(
    ("scenario", "sets", "says"),
    [
        ("film", ("display.tone=log",), "display.tone must be given with asynchronous or cont"),
        ("playback", ("display.tone=clip",), "display.tone must be given with asynchronous"),
        ("sun-and-stars", ("display.drive=causal",), "display.tone=log"),
        ("sun-and-stars", ("display.tone=dark",), "display.tone must be"),
        ("film", ("display.peak=1000 cd/m2",), "display.peak must be given with display.tone"),
        ("sun-and-stars", ("display.peak=1000 lux",), "display.peak must be a luminance"),
        ("glass", ("display.tone_decades=3",), "display.tone_decades must be given with"),
        (
            "sun-and-stars",
            ("display.tone=clip", "display.tone_decades=3"),
            "display.tone_decades must be given with display.tone = log or reinhard alone, not 3",
        ),
    ],
)
def test_what_has_no_tone_is_refused_in_one_line(
    refused: Callable[..., str], tmp_path: Path, scenario: str, sets: tuple[str, ...], says: str
) -> None:
    line = refused("run", scenario, *_words(*sets), "--out", tmp_path / "run")
    assert says in line, line
    assert not (tmp_path / "run").exists()
