"""The page of a run of a continuous camera: reports over time, what single pixels said beside their
true light, and an explorer of the values that the pixels have reported.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Clock, Intensities
from cosim.config.amounts import amount, count, decibel, number, percent
from cosim.report.drawn import Data, save_figure
from cosim.report.figures import INK, LINE, MARK, overview_figure, subplots
from cosim.report.frames import FRAMES, FrameColumn, frames_part
from cosim.report.parts import Card, figure, plot, table
from cosim.report.pictures import mark_pixels
from cosim.report.png import for_display, write_png
from cosim.run.machine import Page
from sensor.continuous.run import STREAM, ContinuousRun
from sensor.continuous.shots import PixelLight
from sensor.sections.provenance import fault_rows, optics_rows
from sensor.sections.unlatched import ContinuousSection

_FULL: Final = 65_535
"""Largest value shown."""
BLUE = "#2f5fa7"
BINS = 200


def continuous_page(judged: ContinuousRun) -> Page:
    """Writes the figures, and makes the page's parts."""
    spec, reports, counts = judged.spec, judged.views.reports, _counts(judged)
    sections = [
        reports_explorer(judged),
        _images(judged, counts),
        _pixels(judged, counts),
        _traffic(judged),
        _machine(judged),
    ]
    figures = sorted(path.name for path in (judged.run.folder / "figures").glob("*.png"))
    return Page(
        spec.title,
        f"{spec.setting.chip.title}, continuous pixels, {number(spec.setting.clock.hz / 1e3)} "
        f"kHz, {count(reports.ticks)} cycles",
        _simulated(judged),
        _cards(judged),
        sections,
        quality="A higher PSNR is better; fewer reports and bits are cheaper to send.",
        commands_do="<p>The same bits, however the run is split.</p>",
        files=[f"figures/{name}" for name in figures],
    )


def _cards(judged: ContinuousRun) -> list[Card]:
    metrics, raw = judged.run.result.metrics, judged.spec.setting.clock.hz
    return [
        ("first", decibel(metrics["continuous_psnr"].value),
         f"PSNR against the true light; SSIM {number(metrics['continuous_ssim'].value)}"),
        ("", number(metrics["report_rate"].value), "reports a pixel and second"),
        ("", count(metrics["bit_rate"].value),
         f"bits a pixel and second; spikes latched at this clock: {count(raw)}"),
    ]  # fmt: skip


def _simulated(judged: ContinuousRun) -> str:
    """What was simulated, for a newcomer."""
    height, width = judged.views.reports.shape
    return (
        f"A camera with {width} x {height} pixels, the {judged.spec.setting.chip.title}, watches "
        f"the scene “{judged.spec.title}” for {amount(judged.run.result.simulated_s, 's', 4)}. "
        "Every pixel watches its own light and reports its value whenever that has changed by more "
        f"than {percent(judged.spec.setting.contrast)}; what stands still is not sent again."
    )


def _images(judged: ContinuousRun, counts: npt.NDArray[np.int64]) -> str:
    ms = 1e3 / judged.spec.setting.clock.hz
    middle = judged.views.shots[len(judged.views.shots) // 2]
    overview_figure(
        [
            (f"true light at {number((middle.cycle + 0.5) * ms, 4)} ms", for_display(middle.truth)),
            ("last report of every pixel", for_display(middle.continuous)),
            (f"reports of each pixel, to {count(counts.max())}", _where(counts)),
        ],
        judged.run.folder / "figures" / "overview.png",
    )
    parts = [
        "<h2>Images at chosen instants</h2><p>True light in the middle of the cycle, and the last "
        "value that every pixel has reported by its end, white of the scene = white, through the "
        "sRGB curve. The linear pictures are in <code>images/</code>.</p>"
    ]
    for shot in judged.views.shots:
        ages = shot.age[shot.age >= 0] * ms
        old = "none"
        if ages.size:
            old = f"median {number(np.median(ages))}, oldest {number(ages.max(), 4)} ms"
        pictures = figure(for_display(shot.truth), "true light") + figure(
            for_display(shot.continuous), f"last reports; their age: {old}"
        )
        parts.append(
            f"<h3>cycle {count(shot.cycle)}, "
            f"{number((shot.cycle + 0.5) * ms, 4)} ms</h3>"
            f'<div class="grid by2">{pictures}</div>'
        )
    return "".join(parts)


def _where(counts: npt.NDArray[np.int64]) -> Any:
    """Reports of each pixel as a picture: black none, white the most, logarithmic."""
    return np.rint(255 * np.log1p(counts) / np.log1p(max(int(counts.max()), 1))).astype(np.uint8)


def _counts(judged: ContinuousRun) -> npt.NDArray[np.int64]:
    """Reports of each pixel, (H, W)."""
    height, width = judged.views.reports.shape
    return np.bincount(judged.views.reports.pixel, minlength=height * width).reshape(height, width)


def _pixels(judged: ContinuousRun, counts: npt.NDArray[np.int64]) -> str:
    figures, points = judged.run.folder / "figures", judged.views.light.points
    data = pixels_figure(
        judged.views.reports, judged.views.light, judged.spec.setting.electrons_per_lux,
        judged.spec.white, [shot.cycle for shot in judged.views.shots], figures / "intensities.png",
    )  # fmt: skip
    middle = judged.views.shots[len(judged.views.shots) // 2]
    marks = mark_pixels(for_display(middle.continuous), points)
    write_png(figures / "pixels.png", marks)
    pair = figure(marks, f"the pixels, on the image of cycle {middle.cycle}") + figure(
        _where(counts),
        f"reports of each pixel: {count(counts.min())} to {count(counts.max())}, logarithmic",
    )
    return (
        "<h2>Single pixels</h2><p>Between its reports a pixel's current is taken to stand still: "
        "what it puts out is a piecewise constant form of its light (Huang 2022, section 3.1). The "
        "true light is what falls on the pixel, behind lens and cross-talk, before its own gain "
        "and dark current.</p>"
        + plot(
            figures / "intensities.png",
            "reports of single pixels over time, and their true light",
            data,
        )
        + f'<div class="grid by2">{pair}</div>'
    )


def pixels_figure(
    reports: Intensities, light: PixelLight, per_lux: float, white: float, instants: list[int],
    path: Path,
) -> Data:  # fmt: skip
    """What each pixel reported, held until its next report, and the light on it, white = 1.
    per_lux, white: electrons a second."""
    ms = 1e3 / reports.clock.hz
    true = np.array(light.level, np.float64) * (per_lux / white)
    when = np.array(light.when) / 1e9
    place, stop = reports.pixel, reports.start + reports.ticks
    rows = len(light.points)
    figure, axes = subplots(rows, 1, figsize=(11, 0.95 * rows + 0.8), sharex=True, squeeze=False)
    for n, ((row, column, label), ax) in enumerate(zip(light.points, axes[:, 0], strict=True), 1):
        mine = place == row * reports.shape[1] + column
        times = np.append(reports.time[mine] + 1, stop) * ms  # known at the tick's end
        values = reports.value[mine] / white
        ax.plot(when, true[:, n - 1], color=MARK, linewidth=1, label="true light")
        if values.size:
            ax.step(times, np.append(values, values[-1]), where="post", color=BLUE, linewidth=1.1,
                    label="reported")  # fmt: skip
            ax.plot(times[:-1], values, ".", color=BLUE, markersize=3.5, label="_nolegend_")
        for instant in instants:
            ax.axvline((instant + 0.5) * ms, color=LINE, linewidth=0.8, zorder=0)
        top = max(float(true[:, n - 1].max()), float(values.max(initial=0)), 1e-3)
        ax.set_ylim(0, top * 1.15)
        ax.set_yticks([0, top], ["0", f"{top:.2g}"], fontsize=7, color=INK)
        ax.set_ylabel(
            f"{n}  {label}, {count(mine.sum())}", rotation=0, ha="right", va="center", fontsize=8.5,
            color=INK,
        )  # fmt: skip
        ax.yaxis.set_label_coords(-0.04, 0.5)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(color=LINE, labelcolor=INK)
    axes[-1, 0].set_xlim(0, stop * ms)
    axes[-1, 0].set_xlabel("time (ms); grey lines: the instants shown above", fontsize=9, color=INK)
    axes[0, 0].set_title(
        "reported (blue) and true light of single pixels, white = 1; how often each reported",
        fontsize=10, color=INK,
    )  # fmt: skip
    figure.tight_layout(h_pad=0.15)
    return save_figure(figure, path)


def _traffic(judged: ContinuousRun) -> str:
    reports, path = judged.views.reports, judged.run.folder / "figures" / "reports.png"
    pixels = reports.shape[0] * reports.shape[1]
    _, first = np.unique(reports.pixel, return_index=True)
    later = np.ones(len(reports), bool)
    later[first] = False
    data = rate_figure(reports.time[later], reports.ticks, pixels, reports.clock, path)
    rows_bits, column_bits = (max(n - 1, 1).bit_length() for n in reports.shape)
    bits, setting = judged.run.result.metrics["bit_rate"].value or 0.0, judged.spec.setting
    rows = [
        ["reports", count(len(reports))],
        ["of them after each pixel's first", count(int(later.sum()))],
        ["reports/s a pixel", number(judged.run.result.metrics["report_rate"].value, 4)],
        ["bits of a report",
         f"{rows_bits} row + {column_bits} column + {setting.converter.bits} value = "
         f"{setting.report_bits}; its time is when it is sent"],
        ["bits/s a pixel", count(bits)],
        ["spikes latched at this clock, bits/s a pixel",
         count(setting.clock.hz)
         + (f", {number(setting.clock.hz / bits)} times as many" if bits else "")],
    ]  # fmt: skip
    rows += [
        [f"{row.stage} at the instants", ", ".join(
            f"{amount(us * 1e-6, 's', 4)} {name}"
            for name, us in (("min", row.min_us), ("median", row.median_us), ("max", row.max_us))
        )]
        for row in judged.run.result.latency
    ]  # fmt: skip
    return (
        "<h2>Reports</h2><p>Every pixel reports at the start; these first reports are left out of "
        "the figure and counted in the table. A shared output is taken to be fast enough: reports "
        "do not wait. A report's age is no delay: what has not changed is not reported again.</p>"
        + plot(path, "reports a pixel and second over time", data)
        + table(["what", "value"], rows)
        + f'<pre>reports = numpy.load("{STREAM}")   # row, column, time (ticks), value '
        "(electrons/s)</pre>"
    )


def rate_figure(
    time: npt.NDArray[np.int64], ticks: int, pixels: int, clock: Clock, path: Path
) -> Data:
    """Reports a pixel and second over time. time: ticks of the reports. A bin is whole ticks."""
    figure, ax = subplots(figsize=(11, 2.8), layout="constrained")
    every = -(-ticks // BINS)
    edges = np.minimum(np.arange(0, ticks + every, every), ticks)
    found, _ = np.histogram(time, edges - 0.5)
    rate = found * clock.hz / np.diff(edges) / pixels
    ax.stairs(rate, edges * (1e3 / clock.hz), fill=True, color=BLUE, linewidth=0)
    ax.set_xlim(0, ticks * 1e3 / clock.hz)
    ax.set_xlabel("time (ms)", color=INK)
    ax.set_ylabel("reports/s a pixel", color=INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(LINE)
    ax.tick_params(color=LINE, labelcolor=INK)
    return save_figure(figure, path)


def _machine(judged: ContinuousRun) -> str:
    spec = judged.spec
    setting, chip, section = spec.setting, spec.setting.chip, spec.section.continuous
    assert section is not None
    plain = ContinuousSection()

    def ground(*names: str) -> str:
        same = all(getattr(section, n) == getattr(plain, n) for n in names)
        return "assumed: the default" if same else "scenario"

    converter, share = setting.converter, setting.floor / spec.white
    full = "1e5 lux at QE 0.7, Huang 2022 section 4.3"
    numbers = [
        ["pixels", f"{chip.width} x {chip.height}",
         "scenario" if section.width or section.height else chip.size_origin],
        ["report clock", f"{number(setting.clock.hz / 1e3)} kHz", "scenario"],
        ["monitor's time constant", f"{number(setting.time_constant * 1e3)} ms",
         ground("time_constant")],
        ["change reported, of the last report", number(setting.contrast), ground("contrast")],
        ["but at least", f"{number(setting.floor)} e/s, {number(share, 2)} of white",
         "6 deviations of shot noise at any light" if section.floor is None else "scenario"],
        ["measuring time", f"{number(setting.measure * 1e3)} ms" if setting.measure else
         "0: the filter is read", ground("measure")],
        ["dead time after a report", f"{number(setting.dead_time * 1e3)} ms", ground("dead_time")],
        ["converter", f"{converter.bits} bits, {converter.exponent_bits} of them an exponent",
         ground("bits", "exponent_bits")],
        ["its full scale, smallest step",
         f"{number(converter.full_scale)}, {number(converter.unit)} e/s",
         full if section.full_scale == plain.full_scale else "scenario"],
        *optics_rows(spec.camera),
        ["lens", f"f/{number(spec.lens.f_number)}, T {number(spec.lens.transmission)}, "
         f"m {number(spec.lens.magnification)}, PSF {spec.lens.psf}",
         "scenario" if spec.section.lens.f_number else "f-number chosen"],
        ["white on the sensor", f"{number(spec.white)} e/s, "
         f"{number(spec.white * setting.time_constant)} electrons a time constant", "computed"],
        *fault_rows(spec.section),
    ]  # fmt: skip
    return (
        "<h2>The machine</h2>"
        + table(["what", "value", "from"], numbers)
        + "<h2>What was kept and what was left out</h2>"
        + table(["effect", "kept in", "bound", "measured"], _plan_rows(judged))
        + "<p>The error is that of reported values, held and averaged over the image windows, "
        "against the same equations computed in another way on a few tiles; with shot noise, whose "
        "electrons are drawn in the limit of many, the distance from single electrons in law is "
        "added.</p>"
    )


def _plan_rows(judged: ContinuousRun) -> list[list[str]]:
    """The effects, and what leaving one out changes."""
    found = {row["effect"]: row for row in judged.run.result.left_out}
    return [
        [row.effect, "all pixels", "", ""]
        if row.effect not in found
        else [row.effect, "none", f"{number(row.bound, 2)}, {row.kind}",
              number(found[row.effect]["measured"], 2)]
        for row in judged.plan.rows
    ]  # fmt: skip


def reports_explorer(judged: ContinuousRun) -> str:
    """HTML of the section."""
    spec, reports = judged.spec, judged.views.reports
    clock, cycles = reports.clock, reports.ticks
    instants = np.unique(np.linspace(0, cycles - 1, min(cycles, FRAMES)).round().astype(np.int64))
    step = max(float(reports.value.max(initial=0.0)), spec.white) / _FULL
    until = np.searchsorted(reports.time, reports.start + instants, side="right")
    last = _Last(reports, until, step)
    figures = [(float(one.mean()), int(one.min()), int(one.max())) for one in map(
        last.read, range(len(instants))
    )]  # fmt: skip
    mean, least, most = zip(*figures, strict=True)
    columns = [
        FrameColumn("Frame", "mean", "", mean),
        FrameColumn("Frame", "least", "", least),
        FrameColumn("Frame", "most", "", most),
        FrameColumn("Reports", "so_far", "", until.tolist()),
        FrameColumn("Reports", "new", "", np.diff(until, prepend=0).tolist()),
    ]
    unit = f"x {amount(step, 'e/s')}"
    part = frames_part(
        [reports.shape] * len(instants), _Last(reports, until, step).read, _FULL,
        [int(t) for t in instants], [clock.middle(int(t)) / 1e9 for t in instants], columns,
        {"new": "since the instant before"}, unit=unit, drawn="new",
    )  # fmt: skip
    return (
        f"<h2>Explore the reports</h2><p>What every pixel has reported last, at {len(instants)} "
        f"instants; a frame is a cycle of the {amount(clock.hz, 'Hz')} clock. Values are in steps "
        f"of {amount(step, 'e/s')}, {_FULL} is the brightest of white and all reports.</p>{part}"
    )


class _Last:
    """The last reports as whole numbers of a step, at instants that are asked for in order."""

    def __init__(self, reports: Intensities, until: npt.NDArray[np.intp], step: float) -> None:
        self._reports, self._until, self._step = reports, until, step
        self._image = np.zeros(reports.shape, np.uint16)
        self._done = 0

    def read(self, n: int) -> npt.NDArray[np.uint16]:
        """The image of the n-th instant, black where nothing was reported; it is changed by the
        next."""
        new = slice(self._done, int(self._until[n]))
        value = np.minimum(np.rint(self._reports.value[new] / self._step), _FULL)
        # Of several reports of a pixel the last one stays.
        self._image.ravel()[self._reports.pixel[new]] = value.astype(np.uint16)
        self._done = new.stop
        return self._image
