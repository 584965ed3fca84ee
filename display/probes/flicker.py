"""How steady light is that should be steady: of a patch, as a photodiode takes it, and of pixels.

A patch of 16 x 16 pixels is filmed for a second and shown. Its rows are driven within 1.6 % of a
cycle of each other, which is left out. Light is taken as its mean over each cycle: what a packet
shorter than a cycle does within it lies above 3 kHz and is in none of the figures but the percent
flicker of the true light, which is then 100.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from cosim import Viform
from display.drives import DRIVES
from display.panels.panel import FramePanel, Projector, SpikePanel
from display.probes.camera import ProbeCamera
from display.probes.light import settling_cycles, steady_light
from display.probes.waveform import every_drive, panel_light
from display.quality.figures import FlickerFigures, flicker_figures
from display.quality.flicker import risk_of
from display.quality.pstlm import LEAST_SECONDS, pst_lm
from display.quality.svm import LEAST_RATE
from display.references.projector import spread_errors

__all__ = ["PATCH", "Flicker", "frame_flicker", "spike_flicker", "spike_pst_lm"]

Values = npt.NDArray[np.float64]
Area = Literal["patch", "pixel"]
PATCH: Final = 16
"""Pixels each way."""
SECONDS: Final = 1.0
"""That SVM needs."""
SETTLING: Final = 4
"""Mean intervals before: held light has settled after two."""
SAMPLES: Final = 40_000
"""A second, of the light of frames."""
SUMMED: Final = 32
"""Planes that PstLM's light is summed over: 1.25 kHz at 40 kHz."""


@dataclass(frozen=True)
class Flicker:
    """A row of the table.

    Attributes:
        display, drive, rate: see `Latency`.
        area: a patch, or single pixels, of which the figures are the median of 16.
        figures: their mean is in packets Q a cycle; of frames, what would be as bright.
    """

    display: str
    drive: str
    rate: float
    area: Area
    figures: FlickerFigures


@dataclass(frozen=True)
class Eye:
    """The observer and panel for which sensitivity is computed.

    Attributes:
        white: cd/m2.
        white_rate: packets Q a cycle that are white.
        per_degree: pixels.
    """

    white: float
    white_rate: float
    per_degree: float


def _row(
    display: str, drive: str, rate: float, area: Area, waves: Values, hz: float, eye: Eye
) -> Flicker:
    """waves: (samples, places). Places that are always dark are left out."""
    lit = [wave for wave in waves.T if wave.max() > 0]
    if not lit:
        none = math.nan
        dark = FlickerFigures(0.0, none, none, none, none, risk_of(0.0, 0.0))
        return Flicker(display, drive, rate, area, dark)
    field = (PATCH if area == "patch" else 1) / eye.per_degree
    white = eye.white * float(np.mean(lit)) / eye.white_rate
    finer = math.ceil(LEAST_RATE / hz)  # a slow clock's light is constant between its samples
    each = [
        flicker_figures(np.repeat(wave, finer), hz * finer, white, (field, field)) for wave in lit
    ]

    def median(name: str) -> float:
        return float(np.median([getattr(one, name) for one in each]))

    ieee = risk_of(
        float(np.median([one.ieee.frequency for one in each])),
        float(np.median([one.ieee.modulation for one in each])),
    )
    figures = FlickerFigures(
        median("mean"), median("percent"), median("index"), median("svm"), median("visibility"),
        ieee,
    )  # fmt: skip
    return Flicker(display, drive, rate, area, figures)


def _film(
    camera: ProbeCamera, panel: SpikePanel, rate: float, seconds: float, seed: int
) -> tuple[Viform, int]:
    """A patch under steady light, and the planes that it takes to settle."""
    clock = camera.clock
    settling = SETTLING / min(rate, 1.0) + settling_cycles(panel)
    before = math.ceil(settling / SUMMED) * SUMMED
    cycles = before + math.ceil(seconds * clock.hz)
    light = steady_light((PATCH, PATCH), camera.lux(rate), clock.edge(cycles + 2))
    shape = max(camera.height, PATCH), PATCH
    return camera.film(light, cycles, shape, seed, (0, PATCH)), before


def spike_flicker(
    camera: ProbeCamera, panel: SpikePanel, rates: Sequence[float], per_degree: float, seed: int
) -> list[Flicker]:
    """Every drive of a panel at these lights (spikes a cycle), patch and pixels."""
    hz = panel.clock.hz
    eye = Eye(panel.luminance, panel.white_rate, per_degree)
    rows = []
    for rate in rates:
        stream, before = _film(camera, panel, rate, SECONDS, seed)
        few = Viform(
            np.ascontiguousarray(stream.words[:, np.arange(PATCH), np.arange(PATCH)][:, None]),
            stream.cycles, stream.clock,
        )  # fmt: skip
        patch = every_drive(stream, panel, group=np.zeros(stream.shape, np.int64))
        single = every_drive(few, panel)
        for drive in DRIVES:
            for area, light in (("patch", patch), ("pixel", single)):
                waves = light[drive][before:]
                rows.append(_row("spike", drive, rate, area, waves, hz, eye))  # type: ignore[arg-type]
    return rows


def spike_pst_lm(
    camera: ProbeCamera, panel: SpikePanel, rate: float, drive: str, seed: int
) -> float:
    """PstLM of a patch, over the least time that its levels need: about a minute of light, and
    therefore as many pixel-cycles as 16 ms of a megapixel."""
    stream, before = _film(camera, panel, rate, LEAST_SECONDS + 1, seed)
    light = panel_light(stream, panel, drive, SUMMED, np.zeros(stream.shape, np.int64))[:, 0]
    return pst_lm(light[before // SUMMED :], panel.clock.hz / SUMMED)


def _strobed(panel: FramePanel) -> Values:
    """(samples, 1) of a second of white: each the mean over its time."""
    if panel.persistence == 1:
        return np.ones((round(SECONDS * SAMPLES), 1))
    frames = np.arange(round(SECONDS * SAMPLES) + 1) * (panel.rate.num / panel.rate.den / SAMPLES)
    whole = np.floor(frames)
    lit = whole + np.minimum((frames - whole) / panel.persistence, 1.0)
    return (np.diff(lit) * (SAMPLES / panel.rate.hz))[:, None]


def _planes(panel: Projector, level: float) -> tuple[Values, Values]:
    """(planes, 1) of a patch and (planes, 16) of pixels, a second: on wherever the carried error
    passes one half."""
    row, column = np.indices((PATCH, PATCH))
    begin = spread_errors(row, column).ravel() + 0.5
    grown = np.arange(math.ceil(SECONDS * panel.rate.hz) + 1)[:, None] * level
    on = np.floor(begin + grown)  # planes that were on so far
    return np.diff(on.mean(axis=1, keepdims=True), axis=0), np.diff(on[:, :: PATCH + 1], axis=0)


def frame_flicker(
    panel: FramePanel | Projector, white_rate: float, luminance: float, rates: Sequence[float],
    per_degree: float,
) -> list[Flicker]:  # fmt: skip
    """A panel of frames fed the true light. luminance: of its white, cd/m2."""
    eye = Eye(luminance, white_rate, per_degree)
    rows = []
    for rate in rates:
        level = min(rate / white_rate, 1.0)
        if isinstance(panel, Projector):
            hz, (patch, single) = panel.rate.hz, _planes(panel, level)
        else:
            hz, patch = float(SAMPLES), _strobed(panel) * level
            single = patch
        rows.append(_row(panel.name, "", rate, "patch", patch * white_rate, hz, eye))
        rows.append(_row(panel.name, "", rate, "pixel", single * white_rate, hz, eye))
    return rows
