"""The adaptive-exposure sensor with the settings of a scenario, and the judge of its exposure
selection; its row in `viform compare`, where it chooses its exposure itself, and its part in
`viform laboratory`.

The selection depends on the number of saturated pixels and on the largest value below saturation.
The shift that the omitted effects may cause in any pixel is estimated on a strip around the largest
value. It is the largest difference there, or the normal limit of the differences for all pixels of
a frame at 99.9 %, whichever is larger, plus one DN for the truncation of the converter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.frames import Frame
from cosim.plan.error import deviations
from cosim.run.result import Latency, Metric
from imagers.adaptive.coupling import coupled_metrics
from imagers.adaptive.device.decision import Search, decide, gather, lengthening
from imagers.adaptive.device.imager import AdaptiveExposure
from imagers.adaptive.device.loop import longest_exposure, shortest_exposure
from imagers.adaptive.device.registers import DEFAULT_LONGEST
from imagers.adaptive.device.signals import Coupling
from imagers.adaptive.device.timing import MINIMUM_CLOCKS, Sequencer, Timing
from imagers.adaptive.pixels import AdaptivePixels, CmosSetting
from imagers.adaptive.section import AdaptiveSection
from imagers.common.kind import Comparison, Setting
from imagers.common.model import (
    ExposureRange,
    FrameFigures,
    ImagerModel,
    JudgeBase,
    View,
    saturation,
    write_all,
)
from imagers.common.scenery import Still
from imagers.run.check import STRIP, cut_rows
from sensor.frame_pixels import Exposed, PixelModel
from sensor.laboratory.bench import Bench
from sensor.laboratory.cameras import Camera

_FULL = 256
"""Full scale of 8 bits before the converter, DN."""
_TRUNCATION = 1.0
"""Largest increase of a difference by truncation, DN."""
FULL: Final = 255
"""Largest 8-bit value, DN; the controller reports 256 for no value."""
HALF: Final = 128
"""Smallest largest value, DN, that keeps the exposure, unless too many pixels are saturated."""
SEARCHES: Final = {"256th": Search.PART, "root": Search.ROOT, "half": Search.HALF}
MARGIN: Final = 2.0
"""Factor by which noise may move a foreseen exposure, up or down: one power of two."""


@dataclass(frozen=True)
class AdaptiveModel(ImagerModel):
    """See `ImagerModel`."""

    section: AdaptiveSection

    @property
    def shape(self) -> tuple[int, int]:
        return self.section.rows, self.section.columns

    @property
    def setting(self) -> CmosSetting:
        s = self.section
        try:
            return CmosSetting(gain=s.gain, celsius=s.temperature, device=s.device_seed)
        except ValueError as exc:
            raise InputError(
                "imager.gain", "such that a full pixel saturates the converter", f"{s.gain:g}",
                str(exc),
            ) from exc  # fmt: skip

    @property
    def timing(self) -> Timing:
        try:
            return Timing.of(*self.shape, self.section.frame_rate)
        except ValueError as exc:
            raise InputError(
                "imager.frame_rate", f"low enough for {self.section.rows} rows",
                f"{self.section.frame_rate:g} Hz", f"lower it ({exc})",
            ) from exc  # fmt: skip

    @property
    def coupling(self) -> Coupling | None:
        """The coupling of the scenario, None where its section is absent."""
        c = self.section.coupling
        return None if c is None else Coupling(c.charge, c.time_constant, c.code, c.idle)

    def make(self) -> AdaptiveExposure:
        s = self.section
        pixels = AdaptivePixels(self.shape, self.setting)
        imager = AdaptiveExposure(pixels, self.timing, coupling=self.coupling)
        imager.write("adaptive_search", int(SEARCHES[s.search]))
        imager.write("adaptive_longest", s.longest)
        imager.write("adaptive_user", s.multiplier)
        imager.write("adaptive_automatic", int(s.adapt))
        if s.threshold is not None:
            imager.write("adaptive_threshold", s.threshold)
        if s.window is not None:
            row, column, rows, columns = s.window
            if row + rows > s.rows or column + columns > s.columns:
                raise InputError(
                    "imager.window", f"within {s.rows} x {s.columns} pixels", str(list(s.window)),
                    "give first row, first column, rows and columns",
                )  # fmt: skip
            imager.write("adaptive_rows", (row + rows - 1) << 16 | row)
            imager.write("adaptive_columns", (column + columns - 1) << 16 | column)
        write_all(imager, s.writes)
        return imager

    def settings(self, pixels: PixelModel) -> Sequence[PixelModel]:
        return [pixels]

    def exposures(self, view: View, stop: int) -> ExposureRange:
        """Exposures that the controller chooses for the brightest pixel without noise, from half to
        double their values."""
        s, timing, setting = self.section, self.timing, self.setting
        edge, sequencer = timing.clock.edge, Sequencer(timing)
        first = 1 if s.adapt else s.multiplier
        ahead, unit = [first, first], MINIMUM_CLOCKS
        spans: list[tuple[int, int]] = []
        while True:
            multiplier = ahead.pop(0)
            frame = sequencer.step(multiplier * unit)
            begin, end = edge(frame.reset(0)), edge(frame.sample(0))
            if edge(frame.start + timing.deciding) > stop:
                break
            spans.append((begin, end))
            lux_seconds = _brightest(view, begin, end)
            value, over = setting.value(lux_seconds / ((end - begin) / 1e12), (end - begin) / 1e12)
            decision = decide(
                multiplier, int(over), None if over else value, threshold=0,
                search=SEARCHES[s.search], longest=s.longest,
            )  # fmt: skip
            ahead.append(decision.multiplier if s.adapt else first)
        spans = spans or [(begin, end)]
        seconds = [(end - begin) / 1e12 for begin, end in spans]
        light = [_brightest(view, *span) for span in spans]
        dark = float(view.least.min()) / max(float(view.most.max()), 1e-300)
        if isinstance(view.scenery, Still):
            lux = view.scenery.lux
            dark = float(lux.min()) / max(float(lux.max()), 1e-300)
        if not s.adapt:
            return ExposureRange(
                (min(light) * dark, max(light)), (min(seconds), max(seconds)), len(spans)
            )
        least, most = unit / timing.clock.hz, (unit << s.longest) / timing.clock.hz
        return ExposureRange(
            (min(light) * dark / MARGIN, max(light) * MARGIN),
            (max(min(seconds) / MARGIN, least), min(max(seconds) * MARGIN, most)),
            len(spans),
        )  # fmt: skip

    def metrics(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> dict[str, Metric]:
        delays = [change.frames for change in changes(frames, view)]
        settled = (
            None if None in delays else max((f for f in delays if f is not None), default=None)
        )
        step = self.setting.lsb / self.setting.responsivity / self.setting.gain
        fine = [t for t in frames if is_settled(t)] or list(frames)
        seconds = [t.seconds for t in fine]
        covered = FULL * max(seconds) / min(seconds)
        last = frames[-1]
        largest = last.state["largest"]
        return {
            "exposure": Metric(last.seconds * 1e6, "us"),
            "exposure_shortest": Metric(min(t.seconds for t in frames) * 1e6, "us"),
            "exposure_longest": Metric(max(t.seconds for t in frames) * 1e6, "us"),
            "frames_to_settle": Metric(
                settled, "frames", "the exposure has not settled in the run"
            ),
            **saturation(frames),
            "saturated_pixels": Metric(last.state["saturated"], "pixels"),
            "largest": Metric(
                largest if largest <= FULL else None, "DN", "every pixel is saturated or masked"
            ),
            "dynamic_range": Metric(20 * np.log10(covered), "dB"),
            "brightest": Metric(256 * step / min(seconds), "lux"),
            "dimmest": Metric(step / max(seconds), "lux"),
            "resets_disturbed": Metric(sum(t.state["disturbed"] for t in frames), "1"),
            **coupled_metrics(imager),
        }

    def latency(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> list[Latency]:
        delays = [c.delay * 1e-6 for c in changes(frames, view) if c.delay is not None]
        if not delays:
            return []
        return [
            Latency(
                "light to the first frame with its right exposure", min(delays),
                float(np.median(delays)), max(delays),
            )
        ]  # fmt: skip

    def judge(
        self, imager: Any, full: frozenset[str], kept: frozenset[str], seed: int
    ) -> AdaptiveJudge:
        return AdaptiveJudge(imager, full, kept, seed)


class AdaptiveJudge(JudgeBase):
    """See `Judge`. Exposures are multiples of the shortest one."""

    def decides(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        return self._imager.controller.judged.user is None

    def chosen(self, frame: Frame) -> int:
        return int(frame.state["next_multiplier"])

    def exposure(self, frame: Frame) -> float:
        return frame.state["multiplier"]

    def in_full(self, rows: Exposed, pixels: Any) -> int:
        judged = self._imager.controller.judged
        values, over = pixels.digitise(rows, self._seed, self._full)
        counting = judged.counting
        statistics = gather(values, over, counting.window, whole_scan=counting.whole_scan)
        return int(judged.chosen(statistics))

    def _reach(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> float:
        """Largest shift of a pixel by the omitted effects, DN."""
        values = frame.values
        brightest = int(np.argmax(np.where(values < _FULL - 1, values, 0).max(axis=1)))
        first = min(max(brightest - STRIP // 2, 0), max(values.shape[0] - STRIP, 0))
        at = slice(first, min(first + STRIP, values.shape[0]))
        full = pixels.convert(cut_rows(rows, at), self._seed, self._full)
        step = full.astype(np.float64) - values[at]
        far = abs(float(step.mean())) + deviations(values.size) * float(step.std())
        return _TRUNCATION + max(float(np.abs(step).max()), far)

    def _surely_full(self, rows: Exposed, pixels: Any, reach: float) -> npt.NDArray[np.bool_]:
        """(H, W) whether a pixel exceeds full scale for every likely noise and fixed pattern."""
        s = pixels.setting
        seconds = float(rows.seconds[0])
        dark, noise = pixels.mean_variance(0.0, seconds)
        unit, more = pixels.mean_variance(1.0, seconds)
        level = dark + (unit - dark) * rows.lux_seconds
        variance = noise + (more - noise) * rows.lux_seconds
        variance = variance + (s.prnu * level) ** 2 + (s.column * _FULL) ** 2
        far = level - deviations(level.size) * np.sqrt(variance)
        return np.asarray(far > _FULL + reach)

    def close(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        window, threshold, whole = self._imager.controller.judged.counting
        inside = (slice(window.top, window.bottom + 1), slice(window.left, window.right + 1))
        reach = self._reach(rows, pixels, frame)
        top = _FULL - 1 - reach
        surely = self._surely_full(rows, pixels, reach)
        least = int(surely[inside].sum())
        most = int((frame.values[inside] >= top).sum())
        if least > threshold:
            return False  # shortened with or without the omitted effects
        if most > threshold:
            return True
        where = (slice(None), slice(None)) if whole else inside
        values, largest = frame.values[where], frame.state["largest"]
        below = values[values < top]
        if largest >= _FULL or not below.size:
            return True
        # A pixel near full scale may be saturated or not. So the largest value is that pixel's, or
        # the largest one below it.
        low = float(below.max() if largest >= top else largest) - reach
        marginal = bool(((values >= top) & ~surely[where]).any())
        high = _FULL - 1.0 if marginal else min(float(largest) + reach, _FULL - 1.0)
        ends = (int(max(np.floor(low), 0)), int(np.ceil(high)))
        return lengthening(ends[0]) != lengthening(ends[1])


def _brightest(view: View, begin: int, end: int) -> float:
    """Exposure of the brightest pixel from `begin` to `end` (ps), lx s."""
    if isinstance(view.scenery, Still):
        course = view.scenery.course.integral(np.array([begin]), np.array([end]))
        return float(view.scenery.lux.max() * course[0])
    return float(view.most.max()) * (end - begin) / 1e12


def is_settled(frame: FrameFigures) -> bool:
    """Whether the decision on a frame keeps its exposure."""
    return frame.state["next_multiplier"] == frame.state["multiplier"] and not frame.state["flag"]


@dataclass(frozen=True)
class Change:
    """A step of the light, and the response of the sensor.

    Attributes:
        ps: instant, ps.
        before, after: factor of all light before and after the step.
        frames: number of frames from the frame exposed at the step to the first settled one; None
            if no frame settles.
        delay: time from the step to the end of readout of that frame, ps; None likewise.
    """

    ps: int
    before: float
    after: float
    frames: int | None
    delay: int | None


def changes(frames: Sequence[FrameFigures], view: View) -> list[Change]:
    """The steps in the course of a static scene; the first is the start of the run."""
    if not isinstance(view.scenery, Still):
        return []
    knots = view.scenery.course.knots
    steps = [(0, 0.0, view.scenery.course.at(0))]
    for (t0, f0), (t1, f1) in pairwise(knots):
        if t1 == t0 and f1 != f0 and t0 > 0:
            steps.append((t0, f0, f1))
    responses = []
    ends = [ps for ps, *_ in steps[1:]] + [2**62]
    for (ps, before, after), until in zip(steps, ends, strict=True):
        inside = [t for t in frames if ps < t.end and t.ready < until]
        settled = next((t for t in inside if t.begin >= ps and is_settled(t)), None)
        if settled is None:
            responses.append(Change(ps, before, after, None, None))
        else:
            later = settled.number - inside[0].number
            responses.append(Change(ps, before, after, later, settled.ready - ps))
    return responses


class AdaptiveComparison(Comparison):
    """See `Comparison`."""

    title = "adaptive-exposure CMOS"

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        return (
            Setting(pixels, shortest_exposure()),
            Setting(pixels, longest_exposure(DEFAULT_LONGEST)),
        )

    def setting(self, section: AdaptiveSection, pixels: Any) -> str:
        return "chosen by itself"


def _bench(seed: int) -> Bench:
    return Bench(
        AdaptivePixels((32, 96)), 1e-10, 0.01, (0.01, 2, 4), rows=32, frames=6, stack=32,
        seed=seed, bias=None,
    )  # fmt: skip


MEASURED: Final = Camera("adaptive-exposure", "adaptive-exposure CMOS imager", _bench)
"""Its part in `viform laboratory`."""
