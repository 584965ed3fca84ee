"""The EBAPS board of a scenario: construction, range of its settings in a run, metrics, and the
judge of its exposure loop; its row in `viform compare`, where its high voltage is set for the
light, and its part in `viform laboratory`.

The loop decides by the mean of a frame. The effects that are left out are assumed to change it by
the mean difference of a strip plus the 99.9 % uncertainty of that mean, subtracted dark frames
included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.frames import Frame
from cosim.light.charts import ASPECT, bar_width, regions
from cosim.plan.error import deviations
from cosim.run.result import Latency, Metric
from imagers.common.kind import Comparison, Setting
from imagers.common.model import (
    ExposureRange,
    FrameFigures,
    ImagerModel,
    JudgeBase,
    View,
    read_latency,
    write_all,
)
from imagers.ebaps.board.adc_lines import AdcLines
from imagers.ebaps.board.crossing import Clocks
from imagers.ebaps.board.timing import LIVE, Timing
from imagers.ebaps.board_report import board_latency, board_metrics
from imagers.ebaps.device.clocked_board import Board
from imagers.ebaps.device.exposure import (
    DARKS,
    WINDOW,
    ExposureRule,
    Linear,
    mean_of_four,
    residual_variance,
    subtract,
)
from imagers.ebaps.device.imager import Ebaps
from imagers.ebaps.device.settling import settle
from imagers.ebaps.pixels import (
    COLUMNS,
    PHOTOCATHODES,
    ROWS,
    EbapsPixels,
    Tube,
    spectral_ratios,
    wanted_exposure,
)
from imagers.ebaps.section import EbapsSection
from imagers.run.check import cut_rows, strips
from sensor.frame_pixels import Exposed, PixelModel
from sensor.laboratory.bench import Bench
from sensor.laboratory.cameras import Camera

Values = npt.NDArray[np.float64]
KELVIN = 273.15
VOLTS: Final = (1500.0, 1000.0, 500.0, 0.0)
"""Voltages of the document's figure 11, V below ground."""
_SHAPE: Final = (32, 32)
"""Pixels for which closed forms are evaluated."""


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


class EbapsJudge(JudgeBase):
    """See `Judge`. Exposures are in ns."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._darks: list[tuple[Exposed, PixelModel]] = []
        self._made: dict[tuple[int, int, frozenset[str]], npt.NDArray[np.uint16]] = {}

    def decides(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        if frame.state["key"]:
            self._darks = [*self._darks, (rows, pixels)][-4:]
            self._made.clear()
            return False
        judged = self._imager.sequencer.judged
        return bool(judged is not None and judged.acts)

    def chosen(self, frame: Frame) -> int:
        return int(frame.state["next_exposure_ns"])

    def exposure(self, frame: Frame) -> float:
        return frame.state["exposure_ns"]

    def _shown(self, rows: Exposed, pixels: PixelModel, at: slice, kept: frozenset[str]) -> Values:
        """The values of these rows of which the loop takes the mean."""
        live = pixels.convert(cut_rows(rows, at), self._seed, kept)
        sequencer = self._imager.sequencer
        if sequencer.judged.raw or not sequencer.subtracts():
            return live.astype(np.float64)
        key = (at.start, at.stop, kept)
        if key not in self._made:
            self._made[key] = mean_of_four([
                model.convert(cut_rows(dark, at), self._seed, kept) for dark, model in self._darks
            ])  # fmt: skip
        return subtract(live, self._made[key], sequencer.pedestal()).astype(np.float64)

    def close(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        judged = self._imager.sequencer.judged
        mean = frame.state["raw_mean" if judged.raw else "mean"]
        reach = 0.0
        for at in strips(rows):
            full, planned = (self._shown(rows, pixels, at, k) for k in (self._full, self._kept))
            step = full - planned
            doubt = deviations(1) * float(step.std()) / np.sqrt(step.size)
            reach = max(reach, abs(float(step.mean())) + doubt)
        count = frame.values.size
        ends = (mean + side * reach for side in (-1, 1))
        low, high = (judged.chosen(round(end * count), count) for end in ends)
        return bool(low != high)

    def in_full(self, rows: Exposed, pixels: PixelModel) -> int:
        whole = slice(0, rows.lux_seconds.shape[0])
        shown = self._shown(rows, pixels, whole, self._full)
        judged = self._imager.sequencer.judged
        return int(judged.chosen(int(shown.sum()), shown.size))


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


class EbapsComparison(Comparison):
    """See `Comparison`."""

    title = "EBAPS"
    note = "corner of an array of 1280 x 1024, whose data rate is given"

    def adjust(
        self, section: EbapsSection, white: float, mean: float, given: frozenset[str]
    ) -> EbapsSection:
        """The highest of the document's voltages at which the range of the loop contains the
        exposure that the light needs, and the exposure at which the loop comes to rest."""
        rule = ExposureRule()
        target = sum(WINDOW) / 2
        choices = (-section.high_voltage,) if "high_voltage" in given else VOLTS
        volts, wanted, pixels = choices[-1], 0.0, EbapsModel(section).pixels
        for volts in choices:
            wanted = wanted_exposure(pixels.at(volts=volts), mean, target)
            if wanted * 1e9 >= rule.shortest:
                break
        changed: dict[str, float] = {"high_voltage": -volts}
        if "exposure" not in given:
            longest = 10 * rule.longest
            clipped = min(max(round(wanted * 1e9), 1), longest) if wanted < 1e3 else 10**12
            changed["exposure"] = settle(rule, Linear.wanting(clipped, rule)).low * 1e-9
        return section.model_copy(update=changed)

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        rule, small = ExposureRule(), replace(pixels, shape=_SHAPE)
        return (
            Setting(small.at(volts=0.0), rule.shortest * 1e-9),
            Setting(small.at(volts=1500.0), rule.longest * 1e-9),
        )

    def sent(self, section: EbapsSection) -> int:
        return ROWS * COLUMNS

    def setting(self, section: EbapsSection, pixels: Any) -> str:
        return f"{section.high_voltage + 0.0:.0f} V"

    def pedestal(self, section: EbapsSection) -> float | None:
        return float(section.pedestal) if section.darks else None


def _bench(seed: int) -> Bench:
    pixels = EbapsPixels(shape=(32, 96))
    rare = {"ion events", "direct light", "photocathode emission"}
    return Bench(
        pixels, pixels.silicon.area, 1e-3, (0.001, 0.1, 0.2), rows=32, levels=8, frames=8,
        stack=32, seed=seed, kept=frozenset(pixels.effects) - rare, linear=0.15,
    )  # fmt: skip


MEASURED: Final = Camera(
    "ebaps", "EBAPS at -1500 V", _bench,
    (
        "photons are counted at 555 nm; the sensitivity of the photocathode is that to a "
        "lamp with infrared light, so that the quantum efficiency may exceed 1",
        "the gain is measured with its excess noise factor F^2: K is K F^2, and the "
        "quantum efficiency is QE/F^2",
        "some ten photoelectrons fill the scale, so slopes are fitted up to 15 % of "
        "saturation; ion events, direct light and photocathode emission are left out",
    ),
)  # fmt: skip
"""Its part in `viform laboratory`."""
