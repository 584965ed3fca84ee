"""The EBAPS board of a scenario: construction, range of its settings in a run, metrics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.clock import PS
from cosim.light.charts import ASPECT, bar_width, regions
from cosim.run.result import Latency, Metric
from imagers.common.model import (
    ExposureRange,
    FrameFigures,
    ImagerModel,
    read_latency,
)
from imagers.common.view import View
from imagers.common.writes import write_all
from imagers.ebaps.board.adc_lines import AdcLines
from imagers.ebaps.board.crossing import Clocks
from imagers.ebaps.board.regions import LIVE
from imagers.ebaps.board.timing import Timing
from imagers.ebaps.board_report import board_latency, board_metrics
from imagers.ebaps.device.clocked_board import Board
from imagers.ebaps.device.darks import DARKS, residual_variance
from imagers.ebaps.device.exposure import ExposureRule
from imagers.ebaps.device.imager import Ebaps
from imagers.ebaps.judge import EbapsJudge
from imagers.ebaps.pixels import PHOTOCATHODES, EbapsPixels, Tube, spectral_ratios
from imagers.ebaps.section import EbapsSection
from sensor.frame_pixels import PixelModel

__all__ = ["KELVIN", "EbapsModel", "live", "settled_at"]

KELVIN = 273.15


@dataclass(frozen=True)
class EbapsModel(ImagerModel):
    """See `ImagerModel`."""

    section: EbapsSection

    @property
    def shape(self) -> tuple[int, int]:
        return self.section.rows, self.section.columns

    @property
    def pixels(self) -> EbapsPixels:
        s = self.section
        return EbapsPixels(
            self.shape, volts=-s.high_voltage, kelvin=s.temperature + KELVIN, device=s.device_seed,
            tube=Tube(sensitivity=PHOTOCATHODES[s.photocathode].sensitivity),
            spectral=spectral_ratios(s.photocathode, s.illuminant, s.wavelength or 555.0),
        )  # fmt: skip

    def make(self) -> Ebaps:
        s = self.section
        imager = Ebaps(self.pixels, board=self._board())
        imager.write("ebaps_high_voltage", round(-s.high_voltage))
        imager.write("ebaps_exposure", round(s.exposure * 1e9))
        imager.write("ebaps_loop", int(s.exposure_loop))
        imager.write("ebaps_subtract", int(s.darks))
        imager.write("ebaps_pedestal", s.pedestal)
        imager.write("ebaps_refresh", int(s.darks and s.exposure_loop))
        if s.darks:
            imager.store_darks()
        write_all(imager, s.writes)
        return imager

    def _board(self) -> Board | None:
        s = self.section.board
        if s is None:
            return None
        lines = AdcLines(s.jitter * PS, s.skew * PS, self.section.device_seed)
        clocks = Clocks(memory=round(s.memory_clock), display=round(s.link_clock))
        return Board(s.frames, lines, clocks, stall=s.stall, depth=s.fifo_words)

    def faults(self, imager: Any) -> list[str]:
        """See `ImagerModel`: what the board was too slow for."""
        return [] if imager.board is None else list(imager.board.faults)

    def settings(self, pixels: PixelModel) -> Sequence[PixelModel]:
        """Pixel settings at every high voltage that the run writes."""
        assert isinstance(pixels, EbapsPixels)
        volts = {-self.section.high_voltage}
        volts |= {
            float(value) for _, register, value in self.section.writes
            if register.removeprefix("ebaps_") == "high_voltage"
        }  # fmt: skip
        return [pixels.at(volts=v) for v in sorted(volts)]

    def exposures(self, view: View, stop: int) -> ExposureRange:
        """Range of exposures; that of the loop if it is on."""
        s, rule, timing = self.section, ExposureRule(), Timing()
        written = [
            value * 1e-9 for _, register, value in s.writes
            if register.removeprefix("ebaps_") == "exposure"
        ]  # fmt: skip
        seconds = [s.exposure, *written]
        if s.exposure_loop:
            seconds += [rule.shortest * 1e-9, rule.longest * 1e-9]
        span = min(seconds), max(seconds)
        frames = 0
        while timing.ps(timing.ready(frames)) <= stop:
            frames += 1
        light = float(view.least.min()) * span[0], float(view.most.max()) * span[1]
        return ExposureRange(light, span, frames)

    def metrics(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> dict[str, Metric]:
        shown = live(frames)
        at = settled_at(frames)
        last = shown[-1] if shown else frames[-1]
        return {
            "exposure": Metric(last.state["exposure_ns"] * 1e-6, "ms"),
            "mean_brightness": Metric(last.state["mean"], "DN"),
            "settled": Metric(last.state["settled"], "1"),
            "frames_to_settle": Metric(
                None if at is None else at, "frames", "the brightness has not settled in the run"
            ),
            "settled_share": Metric(
                float(np.mean([t.state["settled"] for t in shown])) if shown else None,
                "1",
                "every frame is a dark one",
            ),
            "high_voltage": Metric(0 - last.state["high_voltage"], "V"),
            "gain": Metric(
                self.pixels.tube.gain(last.state["high_voltage"]), "electrons/photoelectron"
            ),
            "electrons_per_lux": Metric(
                self.pixels.sensitivity / self.pixels.silicon.area, "1/(s m² lx)"
            ),
            "dark_frames": Metric(sum(t.state["key"] for t in frames), "1"),
            **self._seen(view, imager),
            **({} if imager.board is None else board_metrics(imager.board)),
        }

    def _seen(self, view: View, imager: Any) -> dict[str, Metric]:
        """Metrics of the frames in memory: the spatial pattern of the dark frames, the residual
        after their subtraction from a dark frame (its own noise and a quarter of it), and the
        contrast-to-noise ratio of the chart's largest bar in the last live frame."""
        if not imager.sequencer.subtracts():
            return {}
        darks = np.stack([imager.memory.read(n) for n in range(DARKS)]).astype(np.float64)
        noise = float(darks.var(axis=0, ddof=1).mean())
        pattern = max(float(darks.mean(axis=0).var()) - noise / DARKS, 0.0)
        made = {
            "dark_pattern": Metric(np.sqrt(pattern), "DN"),
            "dark_noise": Metric(np.sqrt(noise), "DN"),
            "dark_residual": Metric(np.sqrt(residual_variance(noise, noise)), "DN"),
        }
        bar = None if view.chart is None else bar_width(view.chart_name, self.shape)
        if bar is None or view.chart is None:
            return made
        shown = imager.memory.read(LIVE).astype(np.float64) - darks.mean(axis=0)
        white, black = (shown[part] for part in regions(view.chart))
        sigma = np.sqrt((white.var() + black.var()) / 2)
        step = abs(float(white.mean() - black.mean()))
        made["bar_width"] = Metric(bar, "pixels")
        made["contrast_to_noise"] = Metric(step * np.sqrt(ASPECT) * bar / sigma, "1")
        return made

    def latency(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> list[Latency]:
        """Time from the start of a row's exposure to the last pixel of the frame, and on the
        board."""
        board = [] if imager.board is None else board_latency(imager.board)
        return read_latency(live(frames)) + board

    def judge(
        self, imager: Any, full: frozenset[str], kept: frozenset[str], seed: int
    ) -> EbapsJudge:
        return EbapsJudge(imager, full, kept, seed)


def live(frames: Sequence[FrameFigures]) -> list[FrameFigures]:
    """Frames of the scene, without the dark frames."""
    return [t for t in frames if not t.state["key"]]


def settled_at(frames: Sequence[FrameFigures]) -> int | None:
    """Number of the first live frame from which the loop stays settled; None if it is not settled
    at the end."""
    found = None
    for frame in reversed(live(frames)):
        if not frame.state["settled"]:
            break
        found = frame.number
    return found
