"""Measures the flicker of steady light: of a patch, as a photodiode sees it, and of single pixels.

A camera records a patch of 16 x 16 pixels for one second, and the display shows it. The row timing
within the patch, 1.6 % of a cycle, is neglected. Light is averaged over each cycle: the waveform of
a packet within a cycle is above 3 kHz and affects only the percent flicker of the true waveform,
which is then 100.
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
from display.probes.setup import ProbeCamera, settling_cycles, steady_light, too_much
from display.probes.waveform import every_drive, panel_light
from display.quality.flicker import LEAST_RATE, FlickerFigures, flicker_figures, risk_of
from display.quality.pstlm import LEAST_SECONDS, pst_lm
from display.references.displays import spread_errors

Values = npt.NDArray[np.float64]
Area = Literal["patch", "pixel"]
AREAS: Final[tuple[Area, Area]] = ("patch", "pixel")
_NONE: Final = FlickerFigures(math.nan, math.nan, math.nan, math.nan, math.nan, risk_of(0.0, 0.0))
"""The figures of a waveform that is not measured."""
PATCH: Final = 16
"""Side of the patch, pixels."""
SECONDS: Final = 1.0
"""Length of the waveform, s, as SVM requires."""
SETTLING: Final = 24
"""Settling time before the waveform, mean intervals: the balance of the dark start is repaid to
0.2 %."""
SAMPLES: Final = 40_000
"""Sampling rate of the light of frames, Hz."""
SUMMED: Final = 32
"""Number of planes over which the light for PstLM is averaged: 1.25 kHz at 40 kHz."""


@dataclass(frozen=True)
class Flicker:
    """The flicker of one display at one light.

    Attributes:
        display, drive, rate: see `Latency`.
        area: a patch, or single pixels; for pixels, the figures are medians of 16.
        figures: figures of the waveform; the mean is in packets Q a cycle, or equivalent for
            frames.
    """

    display: str
    drive: str
    rate: float
    area: Area
    figures: FlickerFigures


@dataclass(frozen=True)
class Eye:
    """Parameters for the sensitivity of the eye.

    Attributes:
        white: luminance of white, cd/m2.
        white_rate: light of white, packets Q a cycle.
        per_degree: pixels per degree of visual angle.
    """

    white: float
    white_rate: float
    per_degree: float


def _row(
    display: str, drive: str, rate: float, area: Area, waves: Values, hz: float, eye: Eye
) -> Flicker:
    """The row for the waveforms `waves`, (samples, places), sampled at `hz`. Places that are always
    dark are ignored."""
    lit = [wave for wave in np.ascontiguousarray(waves.T) if wave.max() > 0]
    if not lit:
        none = math.nan
        dark = FlickerFigures(0.0, none, none, none, none, risk_of(0.0, 0.0))
        return Flicker(display, drive, rate, area, dark)
    field = (PATCH if area == "patch" else 1) / eye.per_degree
    white = eye.white * float(np.mean(lit)) / eye.white_rate
    finer = math.ceil(LEAST_RATE / hz)  # with a slow clock, light is constant between samples
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


def _settling(panel: SpikePanel, rate: float) -> int:
    """Number of planes for settling."""
    settling = SETTLING / min(rate, 1.0) + settling_cycles(panel)
    return math.ceil(settling / SUMMED) * SUMMED


def _film(
    camera: ProbeCamera, panel: SpikePanel, rate: float, seconds: float, seed: int
) -> tuple[Viform, int]:
    """The stream of a patch under steady light, and the number of planes for settling."""
    clock, before = camera.clock, _settling(panel, rate)
    cycles = before + math.ceil(seconds * clock.hz)
    light = steady_light((PATCH, PATCH), camera.lux(rate), clock.edge(cycles + 2))
    shape = max(camera.height, PATCH), PATCH
    return camera.film(light, cycles, shape, seed, (0, PATCH)), before


def spike_flicker(
    camera: ProbeCamera, panel: SpikePanel, rates: Sequence[float], per_degree: float, seed: int
) -> list[Flicker]:
    """The flicker for every drive of a panel, of patch and pixels; NaN where
    `too_much`.

    Args:
        camera, panel: camera and panel.
        rates: lights, spikes a cycle.
        per_degree: pixels per degree of visual angle.
        seed: seed of the noise.
    """
    hz = panel.clock.hz
    eye = Eye(panel.luminance, panel.white_rate, per_degree)
    rows = []
    for rate in rates:
        planes = _settling(panel, rate) + math.ceil(SECONDS * hz)
        if too_much(camera, rate, planes, PATCH**2, (PATCH + 1) * len(DRIVES)):
            rows += [
                Flicker("spike", drive, rate, area, _NONE)
                for drive in DRIVES for area in AREAS
            ]  # fmt: skip
            continue
        stream, before = _film(camera, panel, rate, SECONDS, seed)
        few = Viform(
            np.ascontiguousarray(stream.words[:, np.arange(PATCH), np.arange(PATCH)][:, None]),
            stream.cycles, stream.clock,
        )  # fmt: skip
        patch = every_drive(stream, panel, group=np.zeros(stream.shape, np.int64))
        single = every_drive(few, panel)
        for drive in DRIVES:
            for area, light in zip(AREAS, (patch, single), strict=True):
                waves = light[drive][before:]
                rows.append(_row("spike", drive, rate, area, waves, hz, eye))
    return rows


def spike_pst_lm(
    camera: ProbeCamera, panel: SpikePanel, rate: float, drive: str, seed: int
) -> float:
    """PstLM of a patch over the minimum time, about one minute of light, which has as many
    pixel-cycles as 16 ms of a megapixel."""
    stream, before = _film(camera, panel, rate, LEAST_SECONDS + 1, seed)
    light = panel_light(stream, panel, drive, SUMMED, np.zeros(stream.shape, np.int64))[:, 0]
    return pst_lm(light[before // SUMMED :], panel.clock.hz / SUMMED)


def _strobed(panel: FramePanel) -> Values:
    """The waveform of white on a frame panel for one second, (samples, 1); each sample is a
    mean."""
    if panel.persistence == 1:
        return np.ones((round(SECONDS * SAMPLES), 1))
    frames = np.arange(round(SECONDS * SAMPLES) + 1) * (panel.rate.num / panel.rate.den / SAMPLES)
    whole = np.floor(frames)
    lit = whole + np.minimum((frames - whole) / panel.persistence, 1.0)
    return (np.diff(lit) * (SAMPLES / panel.rate.hz))[:, None]


def _planes(panel: Projector, level: float) -> tuple[Values, Values]:
    """The waveforms of a patch, (planes, 1), and of pixels, (planes, 16), for one second: a pixel
    is on when its carried error crosses one half."""
    row, column = np.indices((PATCH, PATCH))
    begin = spread_errors(row, column).ravel() + 0.5
    grown = np.arange(math.ceil(SECONDS * panel.rate.hz) + 1)[:, None] * level
    on = np.floor(begin + grown)  # planes that were on so far
    return np.diff(on.mean(axis=1, keepdims=True), axis=0), np.diff(on[:, :: PATCH + 1], axis=0)


def frame_flicker(
    panel: FramePanel | Projector, white_rate: float, luminance: float, rates: Sequence[float],
    per_degree: float,
) -> list[Flicker]:  # fmt: skip
    """The flicker of a reference panel that shows the true light.

    Args:
        panel: the reference panel.
        white_rate: light that it shows as white, spikes a cycle.
        luminance: luminance of its white, cd/m2.
        rates: lights, spikes a cycle.
        per_degree: pixels per degree of visual angle.
    """
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
